"""The recorder: everything that a person sees of a run. The only importer of rerun.

Read in this order: journal_file, mirror, activity, deeds, stream, paths, loggers/, blueprint, sink, reader, overview,
look, moments, contact_sheet.
"""
