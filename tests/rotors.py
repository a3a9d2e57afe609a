"""A rigid rotor with a motor, an encoder and a tachometer: what controllers do to it has closed forms."""

import tomllib

from paraflex.files import model_from

# Inertia [kg m^2] and period of sampling [s].
J, T = 0.01, 1e-3

ROTOR = """
name = "rotor"
[ground]
O = [0.0, 0.0]
[body.rotor]
type = "rigid"
mass = 1.0
inertia = 0.01
points = { O = [0.0, 0.0] }
[joint.hub]
type = "revolute"
points = ["ground.O", "rotor.O"]
[motor]
tau = "hub"
[sensor.rate]
type = "tachometer"
joint = "hub"
"""


def rotor(angle=1.0, rate=0.0):
    start = f"""
[start.coordinates]
rotor = {{ x = 0.0, y = 0.0, phi = {angle} }}
[start.rates]
rotor = {{ x = 0.0, y = 0.0, phi = {rate} }}
"""
    return model_from(tomllib.loads(ROTOR + start), "rotor.toml")


def under_rate_feedback(K, rate, samples):
    """Angles of a rotor from zero: J theta'' = -K theta' sampled, with differences, once these are known."""
    angle, last, theta = [0.0], 0.0, 0.0
    for _ in range(samples):
        torque = -K * (theta - last) / T
        last = theta
        theta, rate = theta + rate * T + 0.5 * torque / J * T * T, rate + torque / J * T
        angle.append(theta)
    return angle
