/* SPDX-License-Identifier: MIT */
#include "core/late.h"

#include <dlfcn.h>
#include <errno.h>
#include <string.h>
#include <sys/mman.h>

/* The Makefile reads these sonames from the installed libraries, as a linker would. */
static const struct {
    const char *file, *needs;
} libraries[] = {
    [LATE_proj] = {SONAME_proj, "a grid's coordinates need PROJ"},
    [LATE_assimp] = {SONAME_assimp, "this format needs Assimp"},
    [LATE_tiff] = {SONAME_tiff, "a GeoTIFF needs libtiff"},
    [LATE_websockets] = {SONAME_websockets, "a web link needs libwebsockets"},
};

/* Whether a library that is there found no memory. Where the system says only "failed to map", LARGE bytes are
 * mapped as a trial: none of these libraries is larger. */
static int has_no_memory(const char *why)
{
    const size_t LARGE = 64 << 20;
    if (strstr(why, strerror(ENOMEM)) != NULL) return 1;
    if (strstr(why, "failed to map") == NULL) return 0;
    void *room = mmap(NULL, LARGE, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (room != MAP_FAILED) munmap(room, LARGE);
    return room == MAP_FAILED;
}

int late_load(enum late_library which, const char *const *name, void *calls, size_t n, struct sh_err *err)
{
    const char *file = libraries[which].file;
    void *library = dlopen(file, RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
    if (library == NULL) {
        const char *why = dlerror();
        if (has_no_memory(why))
            return sh_fail(err, SH_ENOMEM, "%s: no memory to load it: %s", libraries[which].needs, why);
        return sh_fail(err, SH_EINPUT, "%s: %s", libraries[which].needs, why);
    }
    for (size_t i = 0; i < n; i++) {
        void *call = dlsym(library, name[i]);
        if (call == NULL)
            return sh_fail(err, SH_EINPUT, "%s lacks the function %s: install another version", file, name[i]);
        memcpy((char *)calls + i * sizeof call, &call, sizeof call);
    }
    return SH_OK;
}
