/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/sidecars.h"

#include <dirent.h>
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

/* The names in a folder, sorted without regard to case. */
struct listing {
    char folder[PATH_MAX];
    char **name;
    size_t n;
    int is_read, is_whole; /* is_whole 0: the folder could not be read, and may have any name */
};

struct search {
    int (*take)(void *ctx, const char *name, const char *path);
    void *ctx;
    char folder[PATH_MAX];     /* of the mesh */
    char here[PATH_MAX];       /* of the file that is being searched, perhaps a library in another folder */
    struct listing listing[2]; /* of `here` and of `folder` */
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

static void forget_listing(struct listing *l)
{
    for (size_t i = 0; i < l->n; i++)
        free(l->name[i]);
    free(l->name);
    *l = (struct listing){0};
}

static int compare_names(const void *a, const void *b)
{
    return strcasecmp(*(char *const *)a, *(char *const *)b);
}

static void read_listing(struct listing *l, const char *folder)
{
    if (l->is_read && strcmp(l->folder, folder) == 0) return;
    forget_listing(l);
    snprintf(l->folder, sizeof l->folder, "%s", folder);
    l->is_read = 1;
    size_t room = 0;
    DIR *dir = opendir(folder[0] != '\0' ? folder : ".");
    l->is_whole = dir != NULL;
    for (const struct dirent *entry; l->is_whole && (entry = readdir(dir)) != NULL;) {
        l->is_whole =
            grow(&l->name, &room, l->n + 1, sizeof(char *)) && (l->name[l->n] = strdup(entry->d_name)) != NULL;
        l->n += (size_t)l->is_whole;
    }
    if (dir != NULL) closedir(dir);
    if (l->n > 0) qsort(l->name, l->n, sizeof(char *), compare_names);
}

static int is_listed(const struct listing *l, const char *part, size_t len)
{
    char name[NAME_MAX_LEN + 1], *key = name;
    snprintf(name, sizeof name, "%.*s", (int)len, part);
    return !l->is_whole || (l->n > 0 && bsearch(&key, l->name, l->n, sizeof(char *), compare_names) != NULL);
}

/* Whether a name can be that of a file in another case: one of the two folders lists the name's first or last part.
 * scene_find_file reads folders for each name, which would take many minutes beside thousands of images. */
static int may_be_there(struct search *s, const char *name)
{
    const char *const folder[] = {s->here, s->folder};
    const char *first = name + strspn(name, "/\\"), *last = name;
    for (const char *p; (p = strpbrk(last, "/\\")) != NULL;)
        last = p + 1;
    for (int i = 0; i < 2; i++) {
        read_listing(&s->listing[i], folder[i]);
        if (is_listed(&s->listing[i], first, strcspn(first, "/\\")) || is_listed(&s->listing[i], last, strlen(last)))
            return 1;
    }
    return 0;
}

/* Finds a name as it stands, or in another case. To be freed; NULL: there is none. */
static char *find_name(struct search *s, const char *name)
{
    const char *const folder[] = {s->here, s->folder};
    char *file = scene_find_file(folder, 2, name, 0);
    return file == NULL && may_be_there(s, name) ? scene_find_file(folder, 2, name, 1) : file;
}

/* Tries the name as it stands, then decoded. Either may be a path on another machine: then only its last part counts,
 * in upper or lower case. */
static int sidecars_find(struct search *s, const char *name, char path[PATH_MAX])
{
    char decoded[NAME_MAX_LEN + 1];
    struct stat st;
    decode(name, decoded);
    char *file = find_name(s, name);
    if (file == NULL) file = find_name(s, decoded);
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

/* The name ends at `end`, and begins at `first` or after one of the blanks between both. A reader prefers the longest
 * name for which there is a file, in any case. */
static int try_names(struct search *s, const char *first, const char *end, int depth)
{
    char name[NAME_MAX_LEN + 1], path[PATH_MAX];
    snprintf(name, sizeof name, "%.*s", (int)(end - first), first);
    for (const char *p = name; p != NULL; p = strchr(p, ' ')) {
        while (*p == ' ')
            p++;
        if (!sidecars_find(s, p, path)) continue;
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
    for (int i = 0; i < 2; i++)
        forget_listing(&s.listing[i]);
    return rc;
}
