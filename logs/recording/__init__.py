"""The rerun recording. The only importer of rerun."""
