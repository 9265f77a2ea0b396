/* SPDX-License-Identifier: MIT */
#include "core/georef/proj_lib.h"

#include <dlfcn.h>

int proj_lib_load(struct proj_lib *lib, struct sh_err *err)
{
    void *handle = dlopen(PROJ_SONAME, RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
    if (handle == NULL) return sh_fail(err, SH_EINPUT, "a grid's coordinates need PROJ: %s", dlerror());
#define PROJ_FIND(call)                          \
    *(void **)&lib->call = dlsym(handle, #call); \
    if (lib->call == NULL)                       \
        return sh_fail(err, SH_EINPUT, "%s is without %s: another version of PROJ is needed", PROJ_SONAME, #call);
    PROJ_CALLS(PROJ_FIND)
#undef PROJ_FIND
    return SH_OK;
}
