"""The models, found by file name: each is NAME.py (record, manual page) and NAME.cl (formula)."""
