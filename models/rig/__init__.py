"""The rig's sections of a case file: rope, payload, drum, winch, sensors and limits."""
