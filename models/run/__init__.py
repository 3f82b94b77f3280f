"""One run in time: its series, statistics, extremes and files."""
