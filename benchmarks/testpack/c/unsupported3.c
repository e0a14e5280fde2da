/* The FMI 3.0 functions that no FMU of the kit offers but some importers insist on finding: they return an error. */
#define NO(name)                                                \
  __attribute__((visibility("default"))) int fmi3##name(void); \
  int fmi3##name(void) { return 3; }
#define NONE(name)                                                \
  __attribute__((visibility("default"))) void *fmi3##name(void); \
  void *fmi3##name(void) { return 0; }

NO(GetNumberOfVariableDependencies) NO(GetVariableDependencies) NO(GetDirectionalDerivative)
NO(GetAdjointDerivative) NO(GetIntervalFraction) NO(GetShiftDecimal) NO(GetShiftFraction)
NO(SetIntervalDecimal) NO(SetIntervalFraction) NO(SetShiftDecimal) NO(SetShiftFraction) NO(EvaluateDiscreteStates)
NO(GetOutputDerivatives) NO(ActivateModelPartition) NONE(InstantiateScheduledExecution)
#ifndef KIT_EXCHANGE
NONE(InstantiateModelExchange) NO(EnterContinuousTimeMode) NO(CompletedIntegratorStep) NO(SetTime)
NO(SetContinuousStates) NO(GetContinuousStateDerivatives) NO(GetEventIndicators) NO(GetContinuousStates)
NO(GetNominalsOfContinuousStates) NO(GetNumberOfEventIndicators) NO(GetNumberOfContinuousStates)
#endif
