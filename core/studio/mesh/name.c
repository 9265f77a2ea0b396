/* SPDX-License-Identifier: MIT */
/* Names of files that a mesh refers to: as URIs in .gltf, as the rest of a line in .obj. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/studio/mesh/inside.h"
#include "core/text.h"
#include "core/utf8.h"

static int is_control(unsigned char c)
{
    return c < 0x20 || c == 0x7f;
}

static int has_control(const char *text)
{
    for (; *text != '\0'; text++)
        if (is_control((unsigned char)*text)) return 1;
    return 0;
}

int mesh_check_name(const char *path, struct sh_err *err)
{
    const char *name = basename(path), *c = strpbrk(name, "%#?:\\");
    if (text_has_ending(name, ".obj") && has_control(name))
        return sh_fail(err, SH_EINPUT,
                       "%s: a line of .obj names its other files; allowed are names without control characters", path);
    if (!text_has_ending(name, ".gltf")) return SH_OK; /* .glb holds all */
    if (!utf8_is_valid(name))
        return sh_fail(err, SH_EINPUT, "%s: this name is not UTF-8, as .gltf has it; allowed is a name in UTF-8", path);
    if (c == NULL) return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "%s: .gltf refers to its other files by URIs, where %c has a special meaning; allowed are names "
                   "without %% # ? : \\",
                   path, *c);
}

/* Whether a URI that may have letters of all languages (RFC 3987) can't have this character. */
static int is_encoded(char c)
{
    return is_control((unsigned char)c) || strchr(" \"<>^`{|}", c) != NULL;
}

char *mesh_uri_of(const char *path)
{
    const char *name = basename(path);
    char *uri = malloc(3 * strlen(path) + 1), *to = uri;
    if (uri == NULL) return NULL;
    to = mempcpy(to, path, (size_t)(name - path));
    for (; *name != '\0'; name++) {
        if (is_encoded(*name))
            to += sprintf(to, "%%%02X", (unsigned char)*name);
        else
            *to++ = *name;
    }
    *to = '\0';
    return uri;
}

void mesh_uri_undo(char *path)
{
    char *name = basename(path), *to = name;
    for (; *name != '\0'; name++) {
        unsigned c;
        if (*name == '%' && sscanf(name + 1, "%2X", &c) == 1) {
            *to++ = (char)c;
            name += 2;
        } else {
            *to++ = *name;
        }
    }
    *to = '\0';
}
