/* The FMI 3.0 functions that the link does not need but some importers insist on finding: they return an error. */
#define NO(name) \
  __attribute__((visibility("default"))) int fmi3##name(void); \
  int fmi3##name(void) { return 3; }
#define NONE(name) \
  __attribute__((visibility("default"))) void *fmi3##name(void); \
  void *fmi3##name(void) { return 0; }

NO(GetFloat32) NO(GetInt8) NO(GetUInt8) NO(GetInt16) NO(GetUInt16) NO(GetInt32) NO(GetUInt32) NO(GetInt64)
NO(GetUInt64) NO(GetBoolean) NO(GetString) NO(GetBinary) NO(GetClock)
NO(SetFloat32) NO(SetInt8) NO(SetUInt8) NO(SetInt16) NO(SetUInt16) NO(SetInt32) NO(SetUInt32) NO(SetInt64)
NO(SetUInt64) NO(SetBoolean) NO(SetString) NO(SetBinary) NO(SetClock)
NO(GetNumberOfVariableDependencies) NO(GetVariableDependencies)
NO(GetFMUState) NO(SetFMUState) NO(FreeFMUState) NO(SerializedFMUStateSize) NO(SerializeFMUState)
NO(DeserializeFMUState) NO(GetDirectionalDerivative) NO(GetAdjointDerivative) NO(EnterConfigurationMode)
NO(ExitConfigurationMode) NO(GetIntervalDecimal) NO(GetIntervalFraction) NO(GetShiftDecimal) NO(GetShiftFraction)
NO(SetIntervalDecimal) NO(SetIntervalFraction) NO(SetShiftDecimal) NO(SetShiftFraction) NO(EvaluateDiscreteStates)
NO(UpdateDiscreteStates) NO(EnterEventMode) NO(EnterStepMode) NO(GetOutputDerivatives)
NO(ActivateModelPartition) NONE(InstantiateModelExchange) NONE(InstantiateScheduledExecution)
NO(EnterContinuousTimeMode) NO(CompletedIntegratorStep) NO(SetTime) NO(SetContinuousStates)
NO(GetContinuousStateDerivatives) NO(GetEventIndicators) NO(GetContinuousStates)
NO(GetNominalsOfContinuousStates) NO(GetNumberOfEventIndicators) NO(GetNumberOfContinuousStates)
