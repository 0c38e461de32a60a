"""How dry friction is taken up, compiled; for the truths whose friction is a level times bristles z within -1..1.

shape > 0     Dahl: z' = v/w (1 - z sgn v)^shape. shape 1 is also LuGre's law for z over its own steady value
shape 0       Maxwell: elements that yield until they slip, then slip. Smooth by a high power, for the integrator's sake
w: distance over which the bristle winds up, plus relaxation times speed.
"""
from numba import njit

SPREAD = (0.25, 1.0, 4.0)  # windings of a Maxwell body's three elements, over the typical one's


@njit
def wound(v, z, winding, relaxation, shape):
    """z'"""
    w = winding + relaxation * abs(v)
    if shape == 1.0:
        return (v - abs(v) * z) / w
    along = z if v > 0 else -z
    if shape == 0.0:
        return v / w * (1 - max(along, 0.0) ** 8)
    rest = 1 - along
    return v / w * (rest**shape if rest > 0 else -((-rest) ** shape))
