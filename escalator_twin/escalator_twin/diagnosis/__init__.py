"""From a recording to a named cause: which part, how large, how sure."""
