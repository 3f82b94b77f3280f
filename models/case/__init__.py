"""The case: all sections of a case file together, read, checked and written again."""
