// Web page, VPL gather from clustered disc lights.
#define VPL_DISCS
#include "web/vpl_gather.frag"
