"""Commands about the world: vessels, seas, motions, case files."""
