"""World files and other TOML, with file and line for every fault."""
