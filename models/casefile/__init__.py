"""What a case file is made of: quantities with units, sections, messages, paths, YAML and TOML."""
