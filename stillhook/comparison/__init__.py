"""The fair comparison of controllers in the same seas."""
