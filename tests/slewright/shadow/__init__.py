"""Tests of slewright/shadow."""
