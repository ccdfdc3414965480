"""What people touch: the command line.

Importing this package imports nothing heavy; the commands import what they need.
"""
