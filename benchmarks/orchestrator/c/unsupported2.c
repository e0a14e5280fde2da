/* The FMI 2.0 functions that the link does not need but some importers insist on finding: they return an error. */
#define NO(name) \
  __attribute__((visibility("default"))) int fmi2##name(void); \
  int fmi2##name(void) { return 3; }

NO(GetInteger) NO(GetBoolean) NO(GetString) NO(SetInteger) NO(SetBoolean) NO(SetString)
NO(GetFMUstate) NO(SetFMUstate) NO(FreeFMUstate) NO(SerializedFMUstateSize) NO(SerializeFMUstate)
NO(DeSerializeFMUstate) NO(GetDirectionalDerivative) NO(SetRealInputDerivatives) NO(GetRealOutputDerivatives)
NO(CancelStep) NO(GetStatus) NO(GetRealStatus) NO(GetIntegerStatus) NO(GetBooleanStatus) NO(GetStringStatus)
