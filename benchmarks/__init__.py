"""Speed, judged as ratios measured in one run; one JSON line each."""
