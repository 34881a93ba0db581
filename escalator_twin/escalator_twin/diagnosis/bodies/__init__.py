"""Diagnosis of machines of free bodies: every cause is run once beside the recording."""
