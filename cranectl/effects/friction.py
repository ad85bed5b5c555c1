"""Friction of the axes and of the cardan joint."""

STICTION_RATE = 0.01  # [rad/s], below which a model without a constraint solver smooths Coulomb's friction
