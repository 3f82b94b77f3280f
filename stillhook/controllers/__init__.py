"""From a name or a design to a controller in time."""
