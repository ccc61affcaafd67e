// Which VPL's visibility map a workgroup works on. The dispatch is two-dimensional, because one side of it may be
// limited to fewer workgroups than there are VPLs.

uniform int vpl_count;

// The index of the workgroup's VPL. In the last row it may be vpl_count or more: then there is nothing to do.
int workgroup_vpl() {
    return int(gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x);
}
