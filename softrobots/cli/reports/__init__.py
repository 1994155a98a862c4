"""Answers of the subcommands: tables for a person, JSON for a machine."""
