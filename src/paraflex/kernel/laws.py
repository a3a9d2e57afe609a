"""Forces given as laws over the motion: operations on quantities of joints and points, and their changes.

A law is a list of operations in the order in which they are evaluated; the last is its value. Each writes a register:
its value, and in tangents also its change along a direction.
"""

from math import acos, asin, atan, cos, cosh, exp, log, sin, sinh, sqrt, tan, tanh

from .arrays import last_before
from .axes import axis_frame, component
from .compiling import inlined, routine
from .joints import end_motion, marker_angle
from .packed import (
    ABS,
    ACOS,
    ADD,
    ASIN,
    ATAN,
    COS,
    COSH,
    DIVIDE,
    EXP,
    LOG,
    MAX,
    MIN,
    MULTIPLY,
    NEGATE,
    NUMBER,
    OF_ANGLE,
    OF_AXIS,
    QUANTITY,
    SIN,
    SINH,
    SUBTRACT,
    TABLE,
    TAN,
    TANH,
    TIME,
)
from .tangent_axes import component_tangent, frame_tangent
from .tangent_points import end_tangent


@routine
def angle_between(system, one, vector):
    """Return the angle of a quantity's marker b less that of a, or its rate or change, depending on the vector."""
    total = 0.0
    if one.b >= 0:
        total += marker_angle(system, system.markers[one.b], vector)
    if one.a >= 0:
        total -= marker_angle(system, system.markers[one.a], vector)
    return total


@routine
def quantity_value(system, k, q, v):
    """Return the value of quantity k: an angle, a travel or a coordinate of a point, or its rate."""
    one = system.quantities[k]
    if one.kind == OF_ANGLE:
        return angle_between(system, one, v) if one.rate else angle_between(system, one, q)
    if one.kind == OF_AXIS:
        d, theta, w, dw, _, _, _, _ = axis_frame(system, one, q, v, v)
        value, rate, _, _ = component(cos(theta), sin(theta), d, w, dw)
        return rate if one.rate else value
    x, y, vx, vy, _, _, _, _ = end_motion(system, one.b, one.bx, one.by, q, v, v)
    if one.rate:
        return vy if one.axis else vx
    return y if one.axis else x


@routine
def quantity_change(system, k, q, v, direction):
    """Return the change of `quantity_value` along a direction."""
    one = system.quantities[k]
    if one.kind == OF_ANGLE:
        return angle_between(system, one, direction.v) if one.rate else angle_between(system, one, direction.q)
    if one.kind == OF_AXIS:
        d, theta, w, dw, _, _, _, _ = axis_frame(system, one, q, v, v)
        change, turn, d_w, d_dw, _, _, _, _ = frame_tangent(system, one, d, q, v, v, direction)
        value, rate, _, _ = component_tangent(cos(theta), sin(theta), d, change, w, dw, turn, d_w, d_dw)
        return rate if one.rate else value
    x, y, vx, vy, _, _, _, _ = end_tangent(system, one.b, q, v, v, direction)
    if one.rate:
        return vy if one.axis else vx
    return y if one.axis else x


@inlined
def curve_at(system, k, x):
    """Return the value of table k at x and its slope; beyond the ends its first or last value."""
    first = system.curve_start[k]
    piece = last_before(system.curve_breaks, first, system.curve_start[k + 1] - 1, x)
    c, z = system.curve_coefficients[piece], x - system.curve_breaks[piece]
    value = c[0] + z * (c[1] + z * (c[2] + z * (c[3] + z * (c[4] + z * c[5]))))
    return value, c[1] + z * (2.0 * c[2] + z * (3.0 * c[3] + z * (4.0 * c[4] + z * 5.0 * c[5])))


@routine
def arithmetic(code, x, y):
    """Return the result of an operation on two numbers, and its derivatives by both."""
    if code == ADD:
        return x + y, 1.0, 1.0
    if code == SUBTRACT:
        return x - y, 1.0, -1.0
    if code == MULTIPLY:
        return x * y, y, x
    if code == DIVIDE:
        return x / y, 1.0 / y, -x / (y * y)
    if code == MIN:
        return (x, 1.0, 0.0) if x <= y else (y, 0.0, 1.0)
    if code == MAX:
        return (x, 1.0, 0.0) if x >= y else (y, 0.0, 1.0)
    value = x**y
    # A zero exponent is not multiplied out: 0 * 0^-1 is NaN.
    return value, y * x ** (y - 1.0) if y != 0.0 else 0.0, value * log(x) if x > 0.0 else 0.0


@routine
def function_at(code, x):
    """Return a function of one number, and its derivative."""
    if code == NEGATE:
        return -x, -1.0
    if code == ABS:
        return (x, 1.0) if x > 0.0 else (-x, -1.0)
    if code == SIN:
        return sin(x), cos(x)
    if code == COS:
        return cos(x), -sin(x)
    if code == TAN:
        value = tan(x)
        return value, 1.0 + value * value
    if code == ASIN:
        return asin(x), 1.0 / sqrt(1.0 - x * x)
    if code == ACOS:
        return acos(x), -1.0 / sqrt(1.0 - x * x)
    if code == ATAN:
        return atan(x), 1.0 / (1.0 + x * x)
    if code == SINH:
        return sinh(x), cosh(x)
    if code == COSH:
        return cosh(x), sinh(x)
    if code == TANH:
        value = tanh(x)
        return value, 1.0 - value * value
    if code == EXP:
        value = exp(x)
        return value, value
    if code == LOG:
        return log(x), 1.0 / x
    value = sqrt(x)
    return value, 0.5 / value


@inlined
def operate(system, one, x, y):
    """Return the result of an operation with operands x and y, and its derivatives by both."""
    if one.code == TABLE:
        value, slope = curve_at(system, one.b, x)
        return value, slope, 0.0
    if one.code >= ADD:
        return arithmetic(one.code, x, y)
    value, slope = function_at(one.code, x)
    return value, slope, 0.0


@routine
def law_value(system, k, q, v, torques, registers):
    """Return the value of law k at (q, v); `torques` has the time where the law contains it, `registers` is scratch."""
    law, value = system.laws[k], 0.0
    for i in range(law.first, law.end):
        one = system.operations[i]
        if one.code == NUMBER:
            value = one.number
        elif one.code == QUANTITY:
            value = quantity_value(system, one.a, q, v)
        elif one.code == TIME:
            value = torques[one.a]
        else:
            value, _, _ = operate(system, one, registers[one.a], registers[max(one.b, 0)])
        registers[i - law.first] = value
    return value


@routine
def law_change(system, k, q, v, torques, direction):
    """Return the value of law k at (q, v) and its change along a direction."""
    law, values, changes = system.laws[k], direction.registers[0], direction.registers[1]
    value, change = 0.0, 0.0
    for i in range(law.first, law.end):
        one = system.operations[i]
        change = 0.0
        if one.code == NUMBER:
            value = one.number
        elif one.code == QUANTITY:
            value, change = quantity_value(system, one.a, q, v), quantity_change(system, one.a, q, v, direction)
        elif one.code == TIME:
            value = torques[one.a]
        else:
            b = max(one.b, 0)
            value, by_x, by_y = operate(system, one, values[one.a], values[b])
            # A slope that is not finite counts only where its operand changes.
            if changes[one.a] != 0.0:
                change += by_x * changes[one.a]
            if changes[b] != 0.0 and by_y != 0.0:
                change += by_y * changes[b]
        values[i - law.first], changes[i - law.first] = value, change
    return value, change
