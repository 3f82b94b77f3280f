"""The question of synthesis: plant, hook, noise and limits of a case, prepared."""
