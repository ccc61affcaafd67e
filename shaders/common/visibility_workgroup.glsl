// Which VPL's map a workgroup makes: rows of workgroups, since one side of a dispatch may be too short for all.

uniform int vpl_count;

// May be vpl_count and more in the last row.
int workgroup_vpl() {
    return int(gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x);
}
