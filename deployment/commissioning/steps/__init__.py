"""The steps of commissioning; `deployment.commissioning.procedure` has their order."""
