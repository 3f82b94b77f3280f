"""Controllers in time: designs, and the laws that the industry uses."""
