"""Commands about a design."""
