"""Tables that `paraflex info` prints."""

from collections.abc import Sequence
from typing import Any

from rich.padding import Padding
from rich.table import Table

from paraflex.errors import listed
from paraflex.files import generator_names
from paraflex.findings import Level
from paraflex.formatting import labelled, number, output_unit
from paraflex.mechanism import Mechanism, groups_of
from .tables import PlainConsole, framed_table

_FREQUENCIES_SHOWN = 3
_LISTED = 12


def print_library(facts: Sequence[dict[str, Any]]) -> None:
    """Print the mechanisms of the library: a line of facts and a description of each."""
    console = PlainConsole()
    for one in facts:
        freedoms = "" if one["degrees_of_freedom"] is None else f"freedoms {one['degrees_of_freedom']}, "
        motors = f"motors {len(one['motors'])}"
        runs = f"along {', '.join(one['paths'])}" if one["paths"] else "on its own"
        if not one["paths"] and one["duration"] is not None:
            runs += f" for {one['duration']:g} s"
        console.print_lines(f"{one['name']}: {freedoms}bodies {one['bodies']}, {motors}; runs {runs}")
        console.print(Padding(one["description"], (0, 0, 0, 4)))
    console.print(f"and of any size, with a number after the name: {', '.join(generator_names())}")
    console.print("paraflex info NAME describes one; paraflex new FILE --from NAME copies one to edit")


def print_facts(facts: dict[str, Any]) -> None:
    """Print a mechanism: counts, loops, redundancies, assemblies, motors, links, frequencies, verdict."""
    console = PlainConsole()
    console.print(f"{facts['name']} ({facts['source']})")
    if facts["description"]:
        console.print(facts["description"])
    console.print(_counts(facts))
    loops = [f"loop {k + 1}: {listed(loop, _LISTED)}" for k, loop in enumerate(facts["loops"])]
    _print_some(console, loops, facts["loop_count"], " loops")
    redundancies = [
        f"redundant: {one['row']}, among {listed(one['among'], _LISTED)}" for one in facts.get("redundancies", [])
    ]
    _print_some(console, redundancies, len(redundancies))
    _print_starts(console, facts)
    if "drives" in facts:
        _print_drives(console, facts)
    console.print(_links(facts))
    if "frequencies" in facts:
        _print_frequencies(console, facts)
    print_verdict(console, facts)


def print_verdict(console: PlainConsole, facts: dict[str, Any]) -> None:
    """Print each finding on a line, then the verdict: sound, doubtful or wrong."""
    verdict = facts["verdict"]
    for one in verdict["findings"]:
        console.print_lines(f"{one['level']}: {one['place']}: {one['text']}; {one['remedy']} [{one['code']}]")
    if verdict["level"] == Level.SOUND.value:
        drives = ", every mode drives all degrees of freedom" if facts["modes"] else ""
        paths = "paths" if facts["several_paths"] else "path"
        path = f", the study's {paths} can be followed" if facts["paths"] else ""
        console.print_lines(f"sound: every assembly closes, the pose is not a special one{drives}{path}")
    else:
        count = len(verdict["findings"])
        console.print(f"verdict: {verdict['level']}, for {count} reason{'s' if count > 1 else ''}")


def _counts(facts: dict[str, Any]) -> Table:
    table = Table(show_header=False, box=None)
    related = [group.plural_noun for group in groups_of(Mechanism).values() if group.relates or group.measures]
    for label, key in (
        ("bodies", "bodies"),
        ("joints", "joints"),
        ("independent loops", "loop_count"),
        ("motors", "motors"),
        ("  following the plan", "following"),
        ("actuators", "actuators"),
        ("prescribed motions", "prescribed"),
        ("loads", "loads"),
        ("coordinates", "coordinates"),
        ("  rigid", "rigid_coordinates"),
        ("  flexible", "flexible_coordinates"),
        ("constraints", "constraints"),
        ("  rank", "rank"),
        ("redundant constraints", "redundant_constraints"),
        ("Gruebler's count (3 bodies - constraints)", "gruebler_count"),
        ("degrees of freedom (3 bodies - rank)", "degrees_of_freedom"),
        (labelled("total mass", output_unit("kg").name), "total_mass"),
        ("assemblies", "assemblies"),
        *((words, words) for words in related),
        ("controllers", "controllers"),
        ("modes", "modes"),
        ("paths", "paths"),
    ):
        # Empty rows of gears and the like are left out, as most mechanisms have none.
        if key in facts and (
            facts[key] or key not in (*related, "following", "actuators", "prescribed", "loads", "controllers")
        ):
            value = facts[key] if key != "total_mass" else output_unit("kg").factor * facts[key]
            if key == "total_mass" and facts["payload"]:
                table.add_row(label, f"{value:g}, including its payload")
                table.add_row("payload", _payload(facts["payload"]))
                continue
            table.add_row(label, (listed(value, _LISTED) or "none") if isinstance(value, list) else f"{value:g}")
    return table


def _payload(carried: dict[str, Any]) -> str:
    """Return the payload of the end-effector and its place in words."""
    inertia = f", {carried['inertia']:g} kg m^2" if carried["inertia"] else ""
    x, y = carried["offset"]
    beside = f", {x:g}, {y:g} m from it" if x or y else ""
    return f"{carried['mass']:g} kg{inertia} at {carried['point']}{beside}"


def _print_some(console: PlainConsole, lines: Sequence[str], count: int, what: str = "") -> None:
    """Print the first lines, and the number of those left out."""
    console.print_lines(*lines[:_LISTED])
    if count > _LISTED:
        console.print(f"and {count - _LISTED} more{what}")


def _print_starts(console: PlainConsole, facts: dict[str, Any]) -> None:
    headings = ("assembly", "gap of the given angles", "closed to [m, rad]", "rates to [1/s]", "remaining gap", "where")
    table = framed_table("assemblies, rigid", headings, right=(1, 2, 3, 4))
    for start in facts["starts"]:
        numbers = [number(start[key], 2, missing="") for key in ("gap_before", "position", "velocity")]
        gap = "none" if start["closes"] else (number(start["gap"], 3) if start["gap"] else "")
        table.add_row(start["assembly"], *numbers, gap, listed(start["where"], _LISTED))
    if facts["starts"]:
        console.print(table)


def _print_drives(console: PlainConsole, facts: dict[str, Any]) -> None:
    drives, freedoms = facts["drives"], facts["degrees_of_freedom"]
    if not facts["motors"] or not freedoms:
        return
    console.print(f"all motors reach {drives['all_motors']} of {freedoms} degrees of freedom")
    sets = [" ".join(motors) for motors in drives["minimal_sets"]]
    if sets:
        more = " at least" if drives["more_sets"] else ""
        console.print_lines(f"sets of motors that suffice,{more} {len(sets)}: {listed(sets, _LISTED)}")


def _links(facts: dict[str, Any]) -> Table:
    long, heavy, often = (output_unit(unit) for unit in ("m", "kg", "Hz"))
    headings = ("body", "kind", f"length [{long.name}]", f"mass [{heavy.name}]", "elements", "coord.",
                f"f1, f2, f3 [{often.name}]")  # fmt: skip
    table = framed_table("bodies, each held in its own frame", headings, right=range(2, 7))
    for link in facts["links"][:_LISTED]:
        lowest = ", ".join(f"{often.factor * f:.1f}" for f in link["frequencies_hz"][:_FREQUENCIES_SHOWN])
        length = "" if link["length"] is None else f"{long.factor * link['length']:g}"
        elements = "" if link["elements"] is None else str(link["elements"])
        mass = f"{heavy.factor * link['mass']:.4f}"
        table.add_row(link["name"], link["kind"], length, mass, elements, str(link["coordinates"]), lowest)
    if len(facts["links"]) > _LISTED:
        table.add_row(f"and {len(facts['links']) - _LISTED} more", "", "", "", "", "", "")
    return table


def _print_frequencies(console: PlainConsole, facts: dict[str, Any]) -> None:
    found, motors = facts["frequencies"], bool(facts["motors"])
    free = "motors free" if motors else "prescribed motions held" if facts["prescribed"] else "lowest"
    pose = "static equilibrium" if found["balanced"] else "undeformed"
    console.print(f"natural frequencies of the assembled mechanism at rest, t = {found['time']:g} s, {pose} [Hz]")
    for label, key in (("motors held", "motors_held_hz"), (free, "motors_free_hz")):
        if found[key] is not None:
            lowest = ", ".join(map(number, found[key][:6]))
            console.print_lines(f"  {label}: {lowest or 'none: nothing can move'}")
    if found["growing"]:
        where = (
            "unstable there" if found["is_equilibrium"] else "the pose is not an equilibrium, so this may be its fall"
        )
        console.print(f"  {found['growing']} motion(s) grow instead of vibrating: {where}")
    if not found["is_equilibrium"]:
        nearby = (
            "--balanced takes the equilibrium nearby"
            if found["equilibrium_nearby"]
            else "there is none nearby, even with its motors held"
            if motors
            else "there is none nearby"
        )
        console.print_lines(
            f"  not an equilibrium: when released it would start with {number(found['acceleration'], 3)} m/s^2, root "
            f"mean square over the mass; {nearby}"
        )
