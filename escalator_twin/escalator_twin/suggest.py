def suggest(path): return ''
