/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/sidecars.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include "core/grow.h"
#include "core/infile.h"
#include "core/scene.h"
#include "core/text.h"
#include "firmware_sim/app/app.h"

enum { NAME_MAX_LEN = 255, DEEPEST = 1 }; /* a mesh names a .mtl, which names images */

struct search {
    int (*take)(void *ctx, const char *name, const char *path);
    void *ctx;
    char folder[PATH_MAX]; /* of the mesh */
    char here[PATH_MAX];   /* of the file that is being searched, perhaps a library in another folder */
    char **seen;
    size_t n_seen;
    struct sh_err *err;
};

/* The length of the ending that begins at a dot; 0: it is none of these. A mesh has a dot in each number, so the first
 * test sorts out most of them. */
static size_t ending_at(const char *p, const char *end)
{
    static const char *const endings[] = {".mtl", ".bin", ".png", ".jpg", ".jpeg", ".tga", ".bmp", ".webp"};
    if (end - p < 2 || strchr("mbpjtw", p[1] | 0x20) == NULL) return 0;
    for (size_t i = 0; i < sizeof endings / sizeof endings[0]; i++) {
        const size_t n = strlen(endings[i]);
        if ((size_t)(end - p) >= n && strncasecmp(p, endings[i], n) == 0) return n;
    }
    return 0;
}

/* Backslashes become slashes, and %XX the byte with these digits. */
static void decode(const char *name, char *out)
{
    for (; *name != '\0'; name++, out++) {
        *out = *name == '\\' ? '/' : *name;
        if (*name != '%' || text_hex_digit(name[1]) < 0 || text_hex_digit(name[2]) < 0) continue;
        *out = (char)(16 * text_hex_digit(name[1]) + text_hex_digit(name[2]));
        name += 2;
    }
    *out = '\0';
}

/* Tries the name as it stands, then decoded. Either may be a path on another machine: then only its last part counts,
 * in upper or lower case. */
static int sidecars_find(const struct search *s, const char *name, int any_case, char path[PATH_MAX])
{
    const char *const folder[] = {s->here, s->folder};
    char decoded[NAME_MAX_LEN + 1];
    struct stat st;
    decode(name, decoded);
    char *file = scene_find_file(folder, 2, name, any_case);
    if (file == NULL) file = scene_find_file(folder, 2, decoded, any_case);
    const int is_found =
        file != NULL && stat(file, &st) == 0 && S_ISREG(st.st_mode) && snprintf(path, PATH_MAX, "%s", file) < PATH_MAX;
    free(file);
    return is_found;
}

static int is_seen(struct search *s, const char *path)
{
    for (size_t i = 0; i < s->n_seen; i++)
        if (strcmp(s->seen[i], path) == 0) return 1;
    return 0;
}

static int search(struct search *s, const char *file, int depth);

static int found(struct search *s, const char *name, const char *path, int depth)
{
    if (!resize(&s->seen, s->n_seen + 1, sizeof(char *)) || (s->seen[s->n_seen] = strdup(path)) == NULL)
        return sh_fail(s->err, SH_ENOMEM, "no memory");
    s->n_seen++;
    int rc = s->take(s->ctx, name, path);
    if (rc != SH_OK || depth == DEEPEST || !app_ends_in(path, ".mtl")) return rc;
    char here[PATH_MAX];
    memcpy(here, s->here, sizeof here);
    rc = search(s, path, depth + 1);
    memcpy(s->here, here, sizeof here);
    return rc;
}

/* The name ends at `end`, and begins at `first` or after one of the blanks between both. To look for a name in another
 * case, folders are read, which takes long in one with thousands of images; so the names as they stand come first. */
static int try_names(struct search *s, const char *first, const char *end, int depth)
{
    char name[NAME_MAX_LEN + 1], path[PATH_MAX];
    snprintf(name, sizeof name, "%.*s", (int)(end - first), first);
    for (int any_case = 0; any_case < 2; any_case++)
        for (const char *p = name; p != NULL; p = strchr(p, ' ')) {
            while (*p == ' ')
                p++;
            if (!sidecars_find(s, p, any_case, path)) continue;
            return is_seen(s, path) ? SH_OK : found(s, p, path, depth);
        }
    return SH_OK;
}

/* Returns whether a character may be part of a name. Control characters, tabs, quotes and any of < > | * ? may not. */
static int is_inside(char c)
{
    return (unsigned char)c >= 0x20 && c != 0x7f && strchr("\"'<>|*?", c) == NULL;
}

static int search_bytes(struct search *s, const char *bytes, size_t len, int depth)
{
    const char *end = bytes + len;
    int rc = SH_OK;
    for (const char *p = bytes; rc == SH_OK && (p = memchr(p, '.', (size_t)(end - p))) != NULL; p++) {
        const size_t n = ending_at(p, end);
        const char *first = p;
        if (n == 0) continue;
        while (first > bytes && (size_t)(p + n - first) < NAME_MAX_LEN && is_inside(first[-1]))
            first--;
        rc = try_names(s, first, p + n, depth);
    }
    return rc;
}

static void set_folder(char folder[PATH_MAX], const char *file)
{
    snprintf(folder, PATH_MAX, "%.*s", (int)(basename(file) - file), file);
}

/* Only the header of a .ply is text. */
static size_t length_of_text(const char *file, const char *bytes, size_t len)
{
    static const char end[] = "end_header";
    const char *at = app_ends_in(file, ".ply") ? memmem(bytes, len, end, sizeof end - 1) : NULL;
    return at != NULL ? (size_t)(at - bytes) : len;
}

static int search(struct search *s, const char *file, int depth)
{
    const char *why;
    struct stat st;
    set_folder(s->here, file);
    FILE *in = infile_open(file, &why);
    if (in == NULL) return sh_fail(s->err, SH_EINPUT, "%s: cannot be read: %s", file, why);
    int rc = SH_OK;
    if (fstat(fileno(in), &st) == 0 && st.st_size > 0) {
        void *bytes = mmap(NULL, (size_t)st.st_size, PROT_READ, MAP_PRIVATE, fileno(in), 0);
        if (bytes == MAP_FAILED) rc = sh_fail(s->err, SH_EIO, "%s: cannot be read", file);
        if (rc == SH_OK) {
            rc = search_bytes(s, bytes, length_of_text(file, bytes, (size_t)st.st_size), depth);
            munmap(bytes, (size_t)st.st_size);
        }
    }
    fclose(in);
    return rc;
}

int app_sidecars(const char *mesh, int (*take)(void *ctx, const char *name, const char *path), void *ctx,
                 struct sh_err *err)
{
    struct search s = {.take = take, .ctx = ctx, .err = err};
    if (app_ends_in(mesh, ".stl")) return SH_OK;
    set_folder(s.folder, mesh);
    int rc = search(&s, mesh, 0);
    for (size_t i = 0; i < s.n_seen; i++)
        free(s.seen[i]);
    free(s.seen);
    return rc;
}
