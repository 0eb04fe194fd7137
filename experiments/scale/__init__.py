"""How fast, how large, how long?"""
