/* SPDX-License-Identifier: MIT */
#include "tests/wire/usage_rig.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char USAGE_GOOD[] = "head: {profile: full-sweep, prr_hz: 100000, lines_hz: 50, pan_deg_s: 100, frames: 1}\n"
                          "scene:\n"
                          "  meshes:\n"
                          "    - {file: room.obj, up: z, scale: 1}\n"
                          "stations:\n"
                          "  - {position_m: [0, 0, 0]}\n"
                          "links: [{type: \"null\"}]\n"
                          "plan: {tolerance_m: 1e-3}\n"; /* and a tenth of it for meshes */

/* Returns how many files the folder holds. */
static int count_files(const struct wire *wire)
{
    DIR *dir = opendir(wire->dir);
    int n = -2;
    while (readdir(dir) != NULL)
        n++;
    closedir(dir);
    return n;
}

/* Counts the lines of a text that are no warnings; *line is the last of them. */
static int count_errors(char *text, char **line)
{
    int n = 0;
    for (char *at = strtok(text, "\n"); at != NULL; at = strtok(NULL, "\n")) {
        if (strncmp(at, "scanhead: warning:", 18) == 0) continue;
        *line = at;
        n++;
    }
    return n;
}

int usage_complaints;

void usage_expect(struct wire *wire, const char *what, const char *const *args, int status, const char *const *says)
{
    int before = count_files(wire);
    int got = wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
    char *err = wire_read(wire_path(wire, "err"), NULL), *out = wire_read(wire_path(wire, "out"), NULL), *line = err;
    remove(wire_path(wire, "err"));
    remove(wire_path(wire, "out"));
    int left = count_files(wire), ends = err[0] != '\0' && err[strlen(err) - 1] == '\n', n = count_errors(err, &line);
    if (got != status) usage_complain("# %s: status %d, not %d: %s", what, got, status, line);
    if (n != 1 || !ends) usage_complain("# %s: %d lines of error: %s", what, n, line);
    if (strncmp(line, "scanhead", 8) != 0) usage_complain("# %s: who says that? %s", what, line);
    for (; *says != NULL; says++)
        if (strstr(line, *says) == NULL) usage_complain("# %s: no '%s' in: %s", what, *says, line);
    if (out[0] != '\0') usage_complain("# %s: output: %.100s", what, out);
    if (left != before) usage_complain("# %s: %d files before, %d after", what, before, left);
    free(err);
    free(out);
}

const char *const *usage_words(const struct wire *wire, const char *line)
{
    static const char *word[WIRE_MAX_ARGS];
    static char text[2048];
    size_t used = 0;
    int n = 0;
    for (const char *p = line; *p != '\0' && used + sizeof wire->dir + 1 < sizeof text; p++)
        used += (size_t)(*p == '@' ? snprintf(text + used, sizeof text - used, "%s/", wire->dir)
                                   : snprintf(text + used, sizeof text - used, "%c", *p));
    for (char *next = strtok(text, " "); next != NULL && n < WIRE_MAX_ARGS - 1; next = strtok(NULL, " "))
        word[n++] = next;
    word[n] = NULL;
    return word;
}
