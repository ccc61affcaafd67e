// The gather from VPLs that are cells, and shine as discs.
#define VPL_DISCS
#include "web/vpl_gather.frag"
