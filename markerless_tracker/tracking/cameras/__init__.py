"""Compares the cameras with each other while a person is tracked, and corrects a wrong one."""
