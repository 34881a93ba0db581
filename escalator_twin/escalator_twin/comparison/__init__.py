"""The twin beside a recording: place it in the loop, run the twin there, score the agreement."""
