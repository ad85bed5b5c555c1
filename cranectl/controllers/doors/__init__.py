"""Laws from outside the package: each door makes a controller of what somebody has."""
