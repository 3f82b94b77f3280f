"""A design: found, evaluated, and told with its limits and its check."""
