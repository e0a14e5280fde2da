"""Commissioning: from a cable to a supervised first motion, step by step, each with checks and a record."""
