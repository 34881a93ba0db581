def suggest(path):
    return ''
