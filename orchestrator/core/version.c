/* From which sources this library was compiled. */
#include "core.h"

#ifndef SLW_SOURCE_HASH
#define SLW_SOURCE_HASH ""
#endif

const char *slw_source_hash(void);
const char *slw_source_hash(void) { return SLW_SOURCE_HASH; }
