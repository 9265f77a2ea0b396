/* SPDX-License-Identifier: MIT */
/* Finds files that a mesh or its library names. Many names come from other machines: with \ for /, with folders that
 * are not here, or in another case. */
#include "core/scene/find_file.h"

#include <dirent.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "core/scene.h"

static bool is_there(const char *path)
{
    struct stat st;
    return stat(path, &st) == 0 && !S_ISDIR(st.st_mode);
}

struct text_span build_folder_of(const char *path)
{
    return (struct text_span){path, (size_t)(basename(path) - path)};
}

char *build_join(struct text_span folder, struct text_span name)
{
    if (name.n > 0 && name.p[0] == '/') folder.n = 0;
    char *path = malloc(folder.n + name.n + 1);
    if (path == NULL) return NULL;
    memcpy(path, folder.p, folder.n);
    for (size_t i = 0; i < name.n; i++)
        path[folder.n + i] = name.p[i] == '\\' ? '/' : name.p[i];
    path[folder.n + name.n] = '\0';
    return path;
}

/* Looks in `folder` for an entry whose name differs from `part` in case only, and writes that name over `part`. `part`
 * is one name of a path and ends with a zero byte. If several entries match, the first in byte order is taken. */
static bool match_part(const char *folder, char *part)
{
    DIR *dir = opendir(folder[0] != '\0' ? folder : ".");
    const size_t len = strlen(part);
    char *best = dir != NULL ? malloc(len + 1) : NULL;
    bool found = false;
    for (struct dirent *entry; best != NULL && (entry = readdir(dir)) != NULL;) {
        if (strlen(entry->d_name) != len || strcasecmp(entry->d_name, part) != 0) continue;
        if (!found || strcmp(entry->d_name, best) < 0) memcpy(best, entry->d_name, len + 1);
        found = true;
    }
    if (found) memcpy(part, best, len + 1);
    free(best);
    if (dir != NULL) closedir(dir);
    return found;
}

/* Changes the case of the path's names, from `at` on, to that of the names on this disk. */
static bool match_case(char *path, size_t at)
{
    for (char *part = path + at; *part != '\0';) {
        char *end = strchrnul(part, '/');
        const char after = *end;
        struct stat st;
        *end = '\0';
        bool found = stat(path, &st) == 0;
        if (!found) {
            char *folder = strndup(path, (size_t)(part - path));
            found = folder != NULL && match_part(folder, part);
            free(folder);
        }
        *end = after;
        if (!found) return false;
        part = end + (after != '\0');
    }
    return is_there(path);
}

static char *find_in(struct text_span folder, struct text_span name, bool any_case)
{
    char *path = name.n > 0 ? build_join(folder, name) : NULL;
    if (path == NULL || is_there(path)) return path;
    if (any_case && path[0] != '\0' && name.p[0] != '/' && match_case(path, folder.n)) return path;
    free(path);
    return NULL;
}

static struct text_span last_part(struct text_span name)
{
    size_t at = name.n;
    while (at > 0 && name.p[at - 1] != '/' && name.p[at - 1] != '\\')
        at--;
    return (struct text_span){name.p + at, name.n - at};
}

char *build_find_file(const struct text_span *folder, size_t n, struct text_span name, int any_case)
{
    char *path = NULL;
    for (int way = 0; way < (any_case ? 4 : 2) && path == NULL; way++)
        for (size_t i = 0; i < n && path == NULL; i++)
            path = find_in(folder[i], way % 2 == 0 ? name : last_part(name), way >= 2);
    return path;
}

char *scene_find_file(const char *const *folder, size_t n, const char *name, int any_case)
{
    struct text_span in[4];
    for (size_t i = 0; i < n; i++)
        in[i] = (struct text_span){folder[i], strlen(folder[i])};
    return build_find_file(in, n, (struct text_span){name, strlen(name)}, any_case);
}
