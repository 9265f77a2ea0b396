/* SPDX-License-Identifier: MIT */
#include "core/late.h"

#include <dlfcn.h>
#include <string.h>

/* The Makefile reads these sonames from the installed libraries, as a linker would. */
static const struct {
    const char *file, *needs;
} libraries[] = {
    [LATE_proj] = {SONAME_proj, "a grid's coordinates need PROJ"},
    [LATE_assimp] = {SONAME_assimp, "this format needs Assimp"},
    [LATE_tiff] = {SONAME_tiff, "a GeoTIFF needs libtiff"},
    [LATE_websockets] = {SONAME_websockets, "a web link needs libwebsockets"},
};

int late_load(enum late_library which, const char *const *name, void *calls, size_t n, struct sh_err *err)
{
    const char *file = libraries[which].file;
    void *library = dlopen(file, RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
    if (library == NULL) return sh_fail(err, SH_EINPUT, "%s: %s", libraries[which].needs, dlerror());
    for (size_t i = 0; i < n; i++) {
        void *call = dlsym(library, name[i]);
        if (call == NULL)
            return sh_fail(err, SH_EINPUT, "%s lacks the function %s: install another version", file, name[i]);
        memcpy((char *)calls + i * sizeof call, &call, sizeof call);
    }
    return SH_OK;
}
