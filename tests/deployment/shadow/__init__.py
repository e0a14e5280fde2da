"""Tests of deployment/shadow."""
