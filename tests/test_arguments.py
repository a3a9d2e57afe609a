"""What a newcomer gives by mistake: taken where it is clear what is meant, else refused by the argument's name."""

import os
import pickle
import warnings
from collections.abc import Iterable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import paraflex as pf
import paraflex.dynamics
import paraflex.mechanism
import paraflex.reports
import paraflex.results
import paraflex.studies
from paraflex.arguments import checked_arguments
from paraflex.elastodynamics import simulate_ked
from paraflex.errors import InputError, ValidityWarning
from paraflex.findings import Finding, Verdict
from paraflex.mechanism import EndEffector, Mechanism, Motor, PointRef, RevoluteJoint, RigidBody, Start, WeldJoint
from paraflex.motion import simulate_motion
from paraflex.results.export import export, result_tables
from paraflex.tracking import simulate

# A call, and how its error begins.
SLIPS = [
    ("RevoluteJoint('O','ground','upper.O')", "joint.O.a: not a point"),
    ("RevoluteJoint('O',3,'upper.O')", "joint.O.a: not a point"),
    ("RevoluteJoint(3,'a.b','upper.O')", "joint.name: not a text"),
    ("RevoluteJoint('O','a.b',None)", "joint.O.b: is not given"),
    ("PrismaticJoint('O','a.b','c.d',direction='90')", "joint.O.direction: not a number"),
    ("SlotJoint('O','a.b',('c',3))", "point.point: not a text"),
    ("WeldJoint('O','a.b','c.d',angle='90')", "joint.O.angle: not a number"),
    ("SlidingJoint('O',['a'],'c.d')", "joint.O.a: not a point"),
    ("PointRef('a',3)", "point.point: not a text"),
    ("Motor('m',3)", "motor.m.joint: not a text"),
    ("Motor(3,'A')", "motor.name: not a text"),
    ("Section('0.1',1)", "section.area: not a number"),
    ("Section.rectangle('30 mm',0.005)", "width: not a number"),
    ("Material('steel',7850)", "material.youngs_modulus: not a number"),
    ("LumpedMass('A','1')", "lump.mass: not a number"),
    ("RigidBody('b','1',1)", "body.b.mass: not a number"),
    ("RigidBody('b',1,1,0.5)", "body.b.centre_of_mass: not two numbers"),
    ("RigidBody('b',1,1,(0,0),[(0,0)])", "body.b.points: not a dictionary"),
    ("RigidBody('b',1,1,(0,0),{'A':0.3})", "body.b.points.A: not two numbers"),
    ("FlexibleBeam('b',1,(0.1,0.2),Material(1,1))", "body.b.section: not a Section or a list"),
    ("FlexibleBeam('b',1,Section(1,1),'steel')", "body.b.material: not a Material or a list"),
    ("FlexibleBeam('b',1,Section(1,1),Material(1,1),elements=2.5)", "body.b.elements: not a whole number or a list"),
    ("FlexibleBeam('b',1,Section(1,1),Material(1,1),points=('A','B'))", "body.b.points: not a dictionary"),
    ("FlexibleBeam('b',1,Section(1,1),Material(1,1),lumps={'A':1.0})", "body.b.lumps: not a LumpedMass"),
    (
        "FlexibleBeam('b',1,Section(1,1),Material(1,1),reference='pined')",
        "body.b.reference: unknown reference condition",
    ),
    ("FlexibleBeam('b',1,Section(1,1),Material(1,1),damping=0.01)", "body.b.damping: not a damping"),
    (
        "AssumedModesBeam('b',1,Section(1,1),Material(1,1),transverse=('sine',))",
        "body.b.transverse: not a Sine or a Polynomial",
    ),
    ("ModalDamping('1 %')", "damping.ratios: not a number"),
    ("RayleighDamping('1')", "damping.mass: not a number"),
    ("TorsionalSpring('s','A','soft')", "spring.s.stiffness: not a number"),
    ("TorsionalDamper('s',3,1)", "damper.s.joint: not a text"),
    ("JointFriction('s','A',None,1)", "friction.s.limit: is not given"),
    ("LinearSpring('s','a.b',3,1)", "linear_spring.s.b: not a point"),
    ("PointForce('f','b.A',9.81)", "load.f.force: not two numbers"),
    ("PointForce('f','A',(0,1))", "load.f.point: not a point"),
    ("AppliedTorque('f','b.A',(0,1))", "load.f.torque: not a number"),
    ("Assembly('a',[1,2])", "assembly.a.angles: not a dictionary"),
    ("Assembly('a',{'b':'90'})", "assembly.a.angles.b: not a number"),
    ("Assembly('a',{},{'b':(1,2)})", "assembly.a.points: not a point"),
    ("Assembly('a',{},{'b.A':1})", "assembly.a.points.b.A: not two numbers"),
    ("ActuationMode('a',3)", "mode.a.motors: not a text"),
    ("EndEffector('C')", "end_effector.point: not a point"),
    ("EndEffector(3)", "end_effector.point: not a point"),
    ("EndEffector('b.C','x y')", "end_effector.coordinates: not a set of task coordinates"),
    ("PrescribedAngle('a','J',3.0)", "prescribed.a.profile: not a profile"),
    ("PrescribedAngle('a','J',lambda t: t)", "prescribed.a.profile: not a profile"),
    ("ConstantSpeed('0',1)", "profile.angle: not a number"),
    ("SampledAngle(1,2,3)", "angle: not a function"),
    ("PiecewiseProfile(3,[1])", "profile.pieces: not a profile"),
    ("TabulatedProfile([0,1],'ab')", "profile.values: not a number"),
    ("Start(angular={'b':'fast'})", "start.angular.b: not a number"),
    ("Start(point={'b':(0,1)})", "start.point: not a point"),
    ("Deflection('1 mm')", "deflection.axial: not a number"),
    ("Mechanism('m',{'O':(0,0)},['b'],[])", "bodies: not a body"),
    ("Mechanism('m',[(0,0)],[],[])", "ground: not a dictionary"),
    ("Mechanism('m',{'O':(0,0)},RigidBody('b',1,1),[],gravity=9.81)", "gravity: not two numbers"),
    ("Mechanism('m',{'O':(0,0)},RigidBody('b',1,1),[],motors={'m':'O'})", "motors: not a Motor"),
    ("Mechanism('m',{'O':(0,0)},RigidBody('b',1,1),[],end_effector='b.C')", "end_effector.point: unknown point"),
    ("Mechanism(3,{},RigidBody('b',1,1),[])", "name: not a text"),
    ("pf.IntegrationOptions(tolerance='1e-5')", "tolerance: not a number"),
    ("pf.IntegrationOptions(newton_fraction=float('inf'))", "newton_fraction: must be below 1"),
    ("pf.IntegrationOptions(events='A')", "events: not an event"),
    ("pf.JointLimit('A','90',1)", "low: not a number"),
    ("pf.Circle((0,0),'1',3)", "radius: not a number"),
    ("pf.Circle(0,1,3)", "centre: not a list of points"),
    ("pf.Polygon(3,3)", "corners: not a list of points"),
    ("pf.Polygon('square',3)", "corners: not a list of points"),
    ("pf.Line(3,3,1)", "start: not a list of points"),
    ("pf.plan(model,'sqare')", "raparm_i.toml: path: unknown path"),
    ("pf.plan(mech,'square')", "path: a mechanism has no paths by name"),
    ("pf.plan(3,'square')", "model: not a model, a mechanism or a text (got 3); give a model, the name or the file of"),
    ("pf.plan(mech,[(0,0.3),(0.1,0.3)])", "path: not a path"),
    ("pf.plan(mech,model)", "path: not a path"),
    ("pf.plan(mech,None)", "path: is not given"),
    ("pf.plan(task,'square')", "model: not a model, a mechanism or a text"),
    ("pf.plan(model,'square',duration='0.7')", "duration: not a number"),
    ("pf.plan(model,'square',duration=-1)", "duration: must be positive"),
    ("pf.plan(model,'square',samples=70.5)", "samples: not a whole number"),
    ("pf.plan(model,'square',samples='70')", "samples: not a whole number"),
    ("pf.plan(model,'square',assembly=1)", "assembly: not a text"),
    ("pf.plan(model,'square',orientation='up')", "orientation: not a number"),
    ("pf.plan(model,'square',after='stop')", "after: unknown ending"),
    ("pf.plan(model,'square',after=1)", "after: not an Ending"),
    ("simulate(model,'++++')", "task: not a task"),
    ("simulate(mech,'++++')", "task: not a task"),
    ("simulate(task,1)", "mode: not an actuation mode"),
    ("simulate(task,['tau1','tau2'])", "mode: not an actuation mode"),
    ("simulate(task,None)", "mode: is not given"),
    ("simulate(task,'++++',method=5)", "method: not a method of integration"),
    ("simulate(task,'++++',method='rk45x')", "method: unknown method"),
    ("simulate(task,'++++',options={'tolerance':1e-5})", "options: not IntegrationOptions"),
    ("simulate(task,'++++',options='esdirk5')", "options: not IntegrationOptions"),
    ("simulate(task,'++++',options=1e-6)", "options: not IntegrationOptions"),
    ("simulate(task,'++++',on_progress=True)", "on_progress: not a function"),
    ("simulate(task,'++++',warning='no')", "warning: not True or False"),
    ("task.simulate(3)", "mode: not an actuation mode"),
    ("task.torques(3)", "mode: not an actuation mode"),
    ("task.mode(3)", "mode: not an actuation mode"),
    ("task.mode(['tau1'])", "mode: not an actuation mode"),
    ("task.in_segments('8')", "segments: not a whole number or a dictionary"),
    ("task.in_segments(2.5)", "segments: not a whole number or a dictionary"),
    ("task.remodelled('linear')", "mechanism: not a mechanism"),
    ("task.balanced(3)", "mode: not an actuation mode"),
    ("simulate_motion(mech,'3')", "duration: not a number"),
    ("simulate_motion('pendulum',3.0)", "mechanism: not a mechanism"),
    ("simulate_motion(pend,0.05,samples=2.5)", "samples: not a whole number"),
    ("simulate_motion(pend,0.05,torques=[1,2])", "torques: not a dictionary"),
    ("simulate_motion(mech,0.01,torques={'tau1':'1'},samples=2)", "torques.tau1: not a number"),
    ("simulate_motion(pend,0.05,start='up')", "assembly: unknown assembly (got 'up'); this mechanism has: level"),
    ("simulate_motion(pend,0.05,start=3)", "start: not a state, a Start or a text"),
    ("simulate_motion(pend,0.05,options=1e-6)", "options: not IntegrationOptions"),
    ("simulate_ked(model,'++++')", "task: not a task"),
    ("simulate_ked(task,3)", "mode: not an actuation mode"),
    ("simulate_ked(task,'++++',step='1e-4')", "step: not a number"),
    ("pf.tracking_dataset(task)", "runs: not a run along a path or a record"),
    ("pf.tracking_dataset(mrun)", "runs: not a run along a path or a record"),
    ("pf.tracking_dataset('run')", "runs: not a run along a path or a record"),
    ("pf.tracking_dataset([])", "runs: no run to keep"),
    ("pf.tracking_dataset(None)", "runs: is not given"),
    ("pf.tracking_dataset(study)", "runs: not a run along a path or a record"),
    ("pf.tracking_dataset([run],options='x')", "options: not IntegrationOptions"),
    ("pf.tracking_dataset([run],parameters=model)", "parameters: not a dictionary"),
    ("pf.tracking_dataset(run,error='max')", "error: unknown error span"),
    ("motion_dataset(run)", "run: not a run without a path"),
    ("motion_dataset([mrun])", "run: not a run without a path"),
    ("motion_dataset(pend)", "run: not a run without a path"),
    ("motion_summary(data)", 'data: these are results of the kind "tracking"'),
    ("motion_summary(mrun)", "data: not a dataset of results"),
    ("pf.summary(mdata)", 'data: these are results of the kind "motion"'),
    ("pf.summary(run)", "data: not a dataset of results"),
    ("pf.summary(study)", "data: not a dataset of results"),
    ("pf.summary('results')", "data: not a dataset of results"),
    ("pf.summary(data,failed=['a'])", "failed: not a dictionary"),
    ("pf.save_results(run,tmp/'x.nc')", "data: not a dataset of results"),
    ("pf.save_results(tmp/'x.nc',data)", "data: not a dataset of results"),
    ("pf.save_results(data,3)", "path: not a file name"),
    ("pf.save_results(data,None)", "path: is not given"),
    ("pf.open_results(3)", "path: not a file name"),
    ("pf.open_results(data)", "path: not a file name"),
    ("pf.open_results('nothing')", "nothing: there is no such file or folder"),
    ("pf.load_results(3)", "path: not a file name"),
    ("kind_of(run)", "data: not a dataset of results"),
    ("tracking_error(run)", "data: not a dataset of results"),
    ("peak_torque(run)", "data: not a dataset of results"),
    ("peak_torque('results')", "data: not a dataset of results"),
    ("rms_torque(mrun)", "data: not a dataset of results"),
    ("tracking_error(mdata)", 'data: these are results of the kind "motion"'),
    ("residual_vibration(mdata, 0.1)", 'data: these are results of the kind "motion"'),
    ("residual_vibration(data,'end')", "motion_end: not a number"),
    ("result_tables(run)", "data: not a dataset of results"),
    ("export('results','csv')", "data: not a dataset of results"),
    ("run_study(model,['++++'])", "task: not a task"),
    ("run_study(task,3)", "modes: not an actuation mode"),
    ("run_study(task,['++++',3])", "modes: not an actuation mode"),
    ("run_study(task,'++++',options=1e-6)", "options: not IntegrationOptions"),
    ("run_study(task,'++++',workers='2')", "workers: not a whole number"),
    ("run_study(task,'++++',method='tr-bdf2')", "method: not a function"),
    ("run_study(task,'++++',error=1)", "error: not an ErrorSpan"),
    ("run_study(task,None)", "modes: is not given"),
    ("verify(model,['++++'])", "task: not a task"),
    ("verify(task,['++++'],models=['rigd'])", "model: unknown model"),
    ("verify(task,'++++',models=3)", "models: not a text"),
    ("verify(task,'++++',options={'segments':2})", "options: not a VerificationOptions"),
    ("VerificationOptions(segments='8')", "segments: not a whole number"),
    ("check_model(3,mech)", "name: not a text"),
    ("reference_model(3)", "models: not a text"),
    ("VerificationStudy(data,['++++'])", "task: not a task"),
    ("VerificationStudy(task,'++++',error=1)", "error: not an ErrorSpan"),
    ("ComparisonStudy(task)", "case: not a case"),
    ("TrackingStudy(model,['++++'])", "task: not a task"),
    ("compare_methods(task)", "case: not a case"),
    ("compare_methods(run)", "case: not a case"),
    ("compare_methods(tracking_case(task,'++++'),'rk4x')", "method: unknown method"),
    ("compare_methods(tracking_case(task,'++++'),3)", "methods: not a method of integration"),
    ("compare_methods(tracking_case(task,'++++'),options=1)", "options: not a ComparisonOptions"),
    ("ComparisonOptions(tolerances='1e-4')", "tolerances: not a number"),
    ("tracking_case(model,'++++')", "task: not a task"),
    ("tracking_case(task,3)", "mode: not an actuation mode"),
    ("motion_case(pend,0.1,start=None)", "start: is not given"),
    ("motion_case(mech,'1',start=3)", "duration: not a number"),
    ("pf.sweep('nostudy.toml',tmp)", "nostudy.toml: file: cannot be read (no such file or directory)"),
    ("pf.sweep(3,tmp)", "study: not a sweep, a file name or a dictionary"),
    ("pf.sweep(model,tmp)", "study: not a sweep, a file name or a dictionary"),
    ("pf.sweep({'a':1},tmp)", "mechanism: is missing"),
    ("pf.sweep('nostudy.toml',3)", "folder: not a file name"),
    ("pf.load_sweep(3)", "file: not a file name"),
    ("pf.load_sweep(model)", "file: not a file name"),
    ("pf.load_sweep('nostudy.toml')", "nostudy.toml: file: cannot be read (no such file or directory)"),
    ("pf.load_optimisation(3)", "file: not a file name"),
    ("pf.load_identification(3)", "file: not a file name"),
    ("pf.load_indices(3)", "file: not a file name"),
    ("pf.load_indices('no.toml',metrics='tracking_rms')", "no.toml: file: cannot be read (no such file or directory)"),
    ("pf.load_sensitivities(3)", "file: not a file name"),
    (
        "pf.load_sensitivities('no.toml',metrics='tracking_rms')",
        "no.toml: file: cannot be read (no such file or directory)",
    ),
    ("pf.optimise(3,tmp)", "study: not an optimisation, a file name or a dictionary"),
    ("pf.optimise(model,tmp)", "study: not an optimisation, a file name or a dictionary"),
    ("pf.optimise('no.toml',tmp)", "no.toml: file: cannot be read (no such file or directory)"),
    ("pf.optimise('no.toml',3)", "folder: not a file name"),
    ("pf.identify(3,tmp)", "study: not an identification, a file name or a dictionary"),
    ("pf.identify('no.toml',None)", "folder: is not given"),
    ("pf.indices(3,tmp)", "study: not an IndicesStudy, a file name or a dictionary"),
    ("pf.indices('no.toml',tmp,samples='3')", "samples: not a whole number"),
    ("pf.sensitivities(3)", "study: not a SensitivityStudy, a file name or a dictionary"),
    ("pf.sensitivities(model)", "study: not a SensitivityStudy, a file name or a dictionary"),
    ("pf.sensitivities('no.toml',at=[1])", "at: not a dictionary"),
    ("pf.load(3)", "name_or_file: not a file name"),
    ("pf.load(None)", "name_or_file: is not given"),
    ("pf.load(model)", "name_or_file: not a file name"),
    ("pf.load(mech)", "name_or_file: not a file name"),
    ("pf.load('raparm')", "mechanism: neither a library mechanism nor a file"),
    ("pf.load_path(3)", "file: not a file name"),
    ("pf.load_path('raparm_i')", "raparm_i: file: cannot be read (no such file or directory)"),
    ("model.path(3)", "name: not a text"),
    ("model.path('sqare')", "raparm_i.toml: path: unknown path"),
    ("pf.library.four_bars_in_a_row('3')", "n: not a whole number"),
    ("pf.library.four_bars_in_a_row(2.5)", "n: not a whole number"),
    ("pf.library.chain_of_segments('3')", "n: not a whole number"),
    ("pf.library.chain_of_segments(3,length='1')", "length: not a number"),
    ("pf.library.raparm_i(e='0.1')", "e: not a number"),
    ("pf.library.raparm_i(section=0.1)", "section: not a Section"),
    ("pf.library.raparm_i(material='steel')", "material: not a Material"),
    ("mech.body('lnk')", "body: unknown body"),
    ("mech.body(3)", "body: unknown body"),
    ("mech.joint('A9')", "joint: unknown joint"),
    ("mech.assembly(3)", "assembly: unknown assembly"),
    ("mech.assembly('out')", "assembly: unknown assembly"),
    ("mech.rigid('lin')", "rigid: unknown body"),
    ("mech.rigid(3)", "names: not a text"),
    ("mech.with_beams(elements='2')", "elements: not a whole number"),
    ("mech.with_beams(elements=2.5)", "elements: not a whole number"),
    ("mech.with_beams(reference='pined')", "reference: unknown reference condition"),
    ("mech.with_beams(modes='2')", "modes: not a whole number"),
    ("mech.refined('2')", "factor: not a whole number"),
    ("mech.refined(2.5)", "factor: not a whole number"),
    ("mech.refined(0)", "body.link1.elements: a span needs at least one element"),
    ("mech.with_geometry(2)", "geometry: not a Geometry"),
    ("mech.with_geometry('quadratic')", "geometry: unknown geometry"),
    ("mech.with_bodies('link')", "bodies: not a body"),
    ("mech.assembly(np.ones(2))", "assembly: unknown assembly"),
    ("mech.reached('')", "start: unknown body"),
    ("mech.reached('link1', [])", "past: not a text"),
    ("mech.sensor_unit('encoder')", "sensor: not"),
    ("model.driven_for(0.1)", "path: not"),
    ("pf.internal_torques([],'++++',[[0.0]])", "task: not a task"),
    ("pf.internal_torques(task,'++++','x')", "torques: not an array of numbers"),
    ("pf.internal_torques(task,'++++',0.0)", "torques: needs one row per sample, one column per motor"),
    ("pf.quantisation_noise([1.0])", "resolution: not a number"),
    ("pf.Differentiator(1j,1e-3,1.0)", "period: not a number"),
    ("pf.BackwardDifference('x')", "period: not a number"),
    ("pf.ComputedTorque(10**400)", "frequency: not a number"),
    ("pf.Polygon(10**400,1.0)", "corners: not a list of points"),
    ("task.in_segments(10**400)", "segments.link1: too many"),
    ("pf.summary(data.drop_dims(list(data.dims)))", "data: not results of paraflex"),
    ("pf.animate(data,3)", "file: not a file name"),
    ("pf.animate(data,'film.gif',modes=3)", "modes: not"),
    ("pf.check(model,modes=np.zeros((2,2)))", "modes: not a text"),
    ("pf.check(model,seen=3)", "seen: not"),
    ("pf.draw(model,width=1.0)", "width: not a possible width of a drawing"),
    ("pf.export(data,'a'+chr(0),'csv')", "output: not a file name"),
    ("model.save('')", "does not name a file"),
    ("pf.states_needed([linear],40.0,methods=[])", "methods: names none"),
    ("linear.frequency_response('x')", "frequencies: not an array of numbers"),
    ("linear.joint_rows(3)", "joints: not"),
    ("linear.motor_joints(3.0)", "motors: not"),
    ("pf.RigidBody('rod',1j,0.1)", "mass: not a number"),
    ("pf.EndEffector(pf.PointRef('a','b'),3)", "end_effector.coordinates: not a set"),
    ("parse_mode(mech,3)", "text: not a text"),
    ("mode_of_signs(mech,3)", "signs: not a text"),
    ("mode_of_motors(mech,3)", "names: not a text"),
    ("finite_segments(mech,'4')", "segments: not a whole number or a dictionary"),
    ("build_system('raparm_i')", "mechanism: not a mechanism"),
    ("consistent_state(mech,mech.assemblies[0])", "system: not a system"),
    ("consistent_state(system,'outwrd')", "assembly: unknown assembly"),
    ("consistent_state(system,3)", "assembly: not a text or an Assembly"),
    ("start_state(system,'up')", "start: not a Start"),
    ("start_state(system,Start(),3)", "assembly: not a text or an Assembly"),
    ("static_equilibrium(mech,task.start)", "system: not a system"),
    ("static_equilibrium(system,'start')", "start: not a state"),
    ("natural_frequencies(mech)", "system: not a system"),
    ("natural_frequencies(model)", "system: not a system"),
    ("natural_frequencies(system,'out')", "state: not a state"),
    ("pf.IntegrationOptions(max_steps='many')", "max_steps: not a whole number"),
    ("pf.IntegrationOptions(parameters=3)", "parameters: parameters belong to the method"),
    ("pf.IntegrationOptions(constraints=3)", "constraints: not a Treatment"),
    ("pf.IntegrationOptions(automatic_gains='yes')", "automatic_gains: not True or False"),
    ("pf.IntegrationOptions(1e-5,'x')", "alpha: not a number"),
    ("pf.JointLimit(3)", "joint: not a text"),
    ("pf.DeflectionLimit('a','1')", "limit: not a number"),
    ("pf.SingularDistance('0.1')", "distance: not a number"),
    ("pf.Line((0,0),'a',3)", "end: not a number"),
    ("pf.Line((0,0),(1,0),'3')", "max_acceleration: not a number"),
    ("pf.Line((0,0),(0,0),3)", "corners: two neighbouring corners coincide"),
    ("pf.Polygon([(0,0),(1,0)],None)", "max_acceleration: is not given"),
    ("pf.Polygon([(0,0),(1,0)],3,closed='no')", "closed: not True or False"),
    ("pf.Circle((0,0),1,3,sweep='360')", "sweep: not a number"),
    ("pf.PointPath('points.csv',1)", "points: not a list of points"),
    ("pf.PointPath([(0,0)],1)", "points: not a list of points"),
    ("plots.end_effector_path(run,'++++')", "data: not a dataset of results"),
    ("plots.end_effector_path(mdata,'++++')", 'data: these are results of the kind "motion"'),
    ("plots.end_effector_path(data,3)", "mode: not a text"),
    ("plots.end_effector_path(data,'++')", "mode: no such mode in these results"),
    ("plots.end_effector_path('nowhere','++++')", "RESULTS: no such file or folder"),
    ("plots.end_effector_path(data,'++++',magnification='10')", "magnification: not a number"),
    ("plots.motor_torques(run)", "data: not a dataset of results"),
    ("plots.motor_torques([data])", "data: not a dataset of results"),
    ("plots.motor_torques(None)", "data: is not given"),
    ("plots.motor_torques(study)", "data: not a dataset of results"),
    ("plots.motion_overview(data)", 'data: these are results of the kind "tracking"'),
    ("plots.mechanism_drawing(model)", "data: not a dataset of results"),
    ("plots.mechanism_drawing(data,time='0.1')", "time: not a number"),
    ("plots.mechanism_drawing(data,magnify='x')", "magnify: not a number"),
    ("plots.tip_deflections(data,'++++',bodies='lin')", "bodies: no such body in these results"),
    ("plots.tip_deflections(data,'++++',bodies=3)", "bodies: not a text"),
    ("plots.compared_links(data,'++++',['linear','rigid'])", 'data: these are results of the kind "tracking"'),
    ("plots.model_distances(data)", 'data: these are results of the kind "tracking"'),
    ("plots.work_precision(data)", 'data: these are results of the kind "tracking"'),
    ("plots.work_precision({})", 'figures: lacks "methods"'),
    ("plots.convergence('nowhere')", "RESULTS: no such file or folder"),
    ("plots.convergence({})", 'figures: lacks "history"'),
    ("plots.convergence(3)", "figures: not a dictionary"),
    ("plots.sobol_bars({})", 'figures: lacks "indices"'),
    ("plots.targets_reached(3)", "figures: not a dictionary"),
    ("plots.elasticities({})", 'figures: lacks "runs"'),
    ("plots.elasticities(3)", "figures: not a dictionary"),
    ("plots.mode_conditions(3)", "rows: not a dictionary"),
    ("plots.mode_conditions(data)", 'data: these are results of the kind "tracking"'),
    ("plots.response_curves(data)", 'data: these are results of the kind "tracking"'),
    ("plots.response_curves('nowhere')", "RESULTS: no such file or folder"),
    ("plots.pareto_front(3)", "table: not a DesignTable"),
    ("plots.parallel_coordinates([1])", "table: not a DesignTable"),
    ("plots.numerical_damping('tr-bdf2')", "curves: not such a row"),
    ("plots.save_figures(run,tmp)", "results: not a dataset of results or a dictionary"),
    ("plots.save_figures(data,3)", "folder: not a file name"),
    ("plots.save_figures(data,tmp,3)", "mode: not a text"),
    ("plots.save_figures({'objective': 3.0},tmp)", "results: not the numbers of a result"),
    ("tracking_page(run)", "data: not a dataset of results"),
    ("tracking_page(mdata)", 'data: these are results of the kind "motion"'),
    ("motion_page(data)", 'data: these are results of the kind "tracking"'),
    ("motion_page(mrun)", "data: not a dataset of results"),
    ("save_page(data,tmp/'p.html')", "page: not a page"),
    ("save_page(tracking_page(data),3)", "path: not a file name"),
]


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    """What the calls above name: all that is public, and one of each thing that is passed on."""
    tmp = tmp_path_factory.mktemp("slips")
    model, pend = pf.load("raparm_i"), pf.load("pendulum")
    task = pf.plan(model, "square", duration=0.01, samples=5)
    run, mrun = task.simulate("++++"), simulate_motion(pend, 0.05, samples=5)
    data = pf.tracking_dataset(run)
    pf.save_results(data, tmp / "results.nc")
    public = [paraflex.mechanism, paraflex.dynamics, paraflex.results, paraflex.studies, paraflex.reports]
    names = {name: getattr(module, name) for module in public for name in dir(module) if not name.startswith("_")}
    functions = [simulate, simulate_ked, simulate_motion, export, result_tables]
    return names | {each.__name__: each for each in functions} | {
        "np": np, "linear": pf.linearise(task, mode="++++"),
        "pf": pf, "plots": pf.plots, "tmp": tmp, "model": model, "mech": model.mechanism, "pend": pend,
        "task": task, "run": run, "mrun": mrun, "data": data, "mdata": paraflex.results.motion_dataset(mrun),
        "system": paraflex.dynamics.build_system(model.mechanism), "study": pf.run_study(task, ["++++"]),
    }  # fmt: skip


@pytest.mark.parametrize(("call", "says"), SLIPS, ids=[call for call, _ in SLIPS])
def test_what_cannot_be_meant_is_refused_by_the_name_of_the_argument(given, call, says):
    with pytest.raises(InputError) as caught:
        eval(call, given)
    assert says in str(caught.value)
    assert caught.value.remedy
    assert "\n" not in str(caught.value)
    assert len(str(caught.value).replace(os.getcwd(), "")) < 330


# A call, and one in full words that gives the same.
TAKEN = [
    (
        "RevoluteJoint('O', 'ground.O', 'upper.O')",
        "RevoluteJoint('O', PointRef('ground', 'O'), PointRef('upper', 'O'))",
    ),
    ("WeldJoint('O', ('ground', 'O'), 'upper.O')", "WeldJoint('O', PointRef('ground', 'O'), PointRef('upper', 'O'))"),
    ("Motor('m', RevoluteJoint('O', 'a.b', 'c.d'))", "Motor('m', 'O')"),
    ("EndEffector('arm.C')", "EndEffector(PointRef('arm', 'C'))"),
    ("Assembly('up', {}, {'arm.C': (0, 1)})", "Assembly('up', {}, {PointRef('arm', 'C'): (0, 1)})"),
    ("ActuationMode('one', 'tau1')", "ActuationMode('one', ('tau1',))"),
    ("replace(mech, bodies=list(mech.bodies))", "mech"),
    ("replace(mech, end_effector=str(mech.end_effector.point))", "mech"),
    ("pf.IntegrationOptions(method=pf.METHODS['bdf'])", "pf.IntegrationOptions(method='bdf')"),
    (
        "pf.IntegrationOptions(events=pf.JointLimit('A', -1, 1))",
        "pf.IntegrationOptions(events=(pf.JointLimit('A', -1, 1),))",
    ),
    ("pf.JointLimit(mech.joints[0], -1, 1)", "pf.JointLimit(mech.joints[0].name, -1, 1)"),
    ("ComparisonOptions(tolerances=1e-4)", "ComparisonOptions(tolerances=(1e-4,))"),
    ("mech.rigid('link1')", "mech.rigid(['link1'])"),
    ("mech.with_bodies(mech.rigid().bodies[0])", "mech.with_bodies([mech.rigid().bodies[0]])"),
    ("parse_mode(model, '++++')", "parse_mode(mech, '++++')"),
    ("finite_segments(model, 2).mechanism", "finite_segments(mech, 2).mechanism"),
    ("build_system(model).mechanism", "mech"),
    ("plan(model, 'square')", "plan(mech, model.path('square'))"),
    ("plan(mech, model.path('square'), assembly=mech.assemblies[0])", "plan(mech, model.path('square'))"),
    ("consistent_state(system, 'outward').q.tolist()", "consistent_state(system, mech.assembly('outward')).q.tolist()"),
    ("simulate_motion(pend, 0.05, samples=3).solution.q.tolist()", "free(pend.mechanism)"),
    ("simulate_motion(started, 0.05, samples=3).solution.q.tolist()", "free(pend.mechanism, start=started.start)"),
    (
        "pf.tracking_dataset(run).to_dict('array')['data_vars']['angle']['data'].tolist()",
        "data['angle'].values.tolist()",
    ),
    ("list(run_study(task, '++++').data['mode'].values)", "['++++']"),
    ("verify(task, '++++', models='rigid').models", "('rigid',)"),
    ("len(plots.end_effector_path(tmp, '++++').axes)", "len(plots.end_effector_path(data, '++++').axes)"),
    ("len(plots.motor_torques(data=str(tmp / 'results.nc')).axes)", "len(plots.motor_torques(data).axes)"),
]


@pytest.mark.parametrize(("call", "full"), TAKEN, ids=[call for call, _ in TAKEN])
def test_what_can_be_meant_in_one_way_is_taken(given, call, full):
    def plan(*arguments, **others):
        return pf.plan(*arguments, duration=0.01, samples=3, **others).motion.q.tolist()

    def free(mechanism, **others):
        return simulate_motion(mechanism, 0.05, samples=3, **others).solution.q.tolist()

    started = replace(given["pend"], start=Start(angular={"beam": 1.0}))
    names = given | {"plan": plan, "free": free, "started": started, "replace": replace}
    assert eval(call, names) == eval(full, names)


def test_the_first_mechanism_of_a_newcomer_can_be_written_in_texts():
    rod = RigidBody("rod", 1.0, 0.1, (0.5, 0.0), {"O": (0.0, 0.0), "E": [1.0, 0.0]})
    joint = RevoluteJoint("O", "ground.O", "rod.O")
    made = Mechanism("rod", {"O": (0.0, 0.0)}, rod, joint, motors=Motor("m", joint), end_effector="rod.E")
    assert made.bodies == (rod,)
    assert made.motors == (Motor("m", "O"),)
    assert made.end_effector == EndEffector(PointRef("rod", "E"))
    assert pickle.loads(pickle.dumps(made)) == made


def test_numbers_of_arrays_are_numbers_and_what_no_float_can_be_is_none():
    for mass in (np.float32(2.0), np.int64(2), np.array(2.0)):
        assert RigidBody("rod", mass, 0.1).mass == mass
    for mass in (2.0 + 1e-20j, 10**400, np.array(2j), np.array("2"), np.datetime64("2026-01-01")):
        with pytest.raises(InputError, match="mass: not a number"):
            RigidBody("rod", mass, 0.1)
    assert WeldJoint("O", "a.b", "c.d", np.pi).angle == np.pi


def test_a_dataclass_that_is_a_sequence_is_many_and_not_one():
    # Every study along a path hands its verdict on as findings.
    @checked_arguments()
    def count(findings: Iterable[Finding]) -> int:
        return len(list(findings))

    one = Finding("size", "body", "large", "look")
    assert [count(given) for given in (one, Verdict(), Verdict([one]), [one], ())] == [1, 0, 1, 1, 0]


def test_annotations_that_only_type_checkers_know_are_not_checked():
    @checked_arguments()
    def named(known: int, unknown: "Nowhere") -> object:  # noqa: F821
        return unknown

    assert named(1, "any") == "any"
    with pytest.raises(InputError, match=r"^known: not a whole number \(got 1\.5\); give a whole number$"):
        named(1.5, "any")


def test_a_warning_names_the_line_that_asked_for_the_run(given):
    runs = [lambda: simulate(given["task"], "++++"), lambda: given["task"].simulate("++++")]
    for run in runs:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            run()
        assert [(each.category, each.filename) for each in caught] == [(ValidityWarning, __file__)]


def test_a_task_is_no_model(given):
    """It has a mechanism, and a path of its own that would be left out."""
    with pytest.raises(
        InputError, match=r"^model: not a model, a mechanism or a text \(got a TrackingTask\); give a model, the"
    ):
        pf.plan(given["task"], given["model"].path("square"))
    with pytest.raises(InputError, match=r"^model: not a model, a mechanism or a text \(got namespace"):
        pf.plan(SimpleNamespace(mechanism=3, paths={}), "square")


def test_equal_types_are_named_in_the_order_of_the_annotation():
    """`float | dict` equals `dict | float`, also within a list; the message of each follows its own annotation."""

    @checked_arguments()
    def table_first(value: dict | float, values: list[dict | float] = ()):
        return value, values

    @checked_arguments()
    def number_first(value: float | dict, values: list[float | dict] = ()):
        return value, values

    for call, wanted in [(table_first, "a dictionary or a number"), (number_first, "a number or a dictionary")]:
        with pytest.raises(InputError, match=f"^value: not {wanted} .*; give {wanted}$"):
            call("three")
        with pytest.raises(InputError, match=f"^values: not {wanted} "):
            call(3.0, ["three"])
