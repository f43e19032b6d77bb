"""The cell's other half: a controller, three servos and the true joints, from the specification.

Nothing of the rest of sphmctl is imported here, so that a codec bug cannot cancel itself.
"""
