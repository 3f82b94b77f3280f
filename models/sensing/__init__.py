"""Sensors and telemetry between the plant and a controller, and the controller's protocol."""
