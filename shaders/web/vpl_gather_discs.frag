// The gather from VPLs that are cells, and shine as discs.
#define VPL_CELLS
#include "web/vpl_gather.frag"
