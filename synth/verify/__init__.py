"""The second look at a design, by code that the search did not use."""
