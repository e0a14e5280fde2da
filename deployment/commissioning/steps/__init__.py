"""The steps of commissioning; `slewright.commissioning.procedure` has their order."""
