/* SPDX-License-Identifier: MIT */
/* The two readers, each a program of node in a process of its own (core/import/import_apart.h). */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/import/ifc/ifc_read.h"
#include "core/import/import_apart.h"

enum { PATH_LEN = 1024 };

/* Places of the readers, from the program's folder: where they are installed, and where they are built. Programs of
 * tests and of the bench lie deeper. */
static const char *const places[] = {"../share/scanhead/ifc", "ifc", "../ifc", "../../ifc", "../../../ifc"};

static bool has_readers(const char *folder)
{
    char path[PATH_LEN + 64];
    snprintf(path, sizeof path, "%s/node_modules/web-ifc/package.json", folder);
    if (access(path, R_OK) != 0) return false;
    snprintf(path, sizeof path, "%s/node_modules/@ifc-lite/wasm/package.json", folder);
    return access(path, R_OK) == 0;
}

static bool find_folder(const struct scene_import_limits *limits, char folder[PATH_LEN])
{
    char program[PATH_LEN / 2];
    if (limits->ifc_folder != NULL) {
        snprintf(folder, PATH_LEN, "%s", limits->ifc_folder);
        return has_readers(folder);
    }
    const ssize_t n = readlink("/proc/self/exe", program, sizeof program - 1);
    const char *slash = n > 0 ? memrchr(program, '/', (size_t)n) : NULL;
    for (size_t i = 0; slash != NULL && i < sizeof places / sizeof places[0]; i++) {
        snprintf(folder, PATH_LEN, "%.*s/%s", (int)(slash - program), program, places[i]);
        if (has_readers(folder)) return true;
    }
    return false;
}

/* Looks for node where execvp does. */
static bool has_node(void)
{
    const char *path = getenv("PATH");
    char file[PATH_LEN];
    for (const char *p = path; p != NULL && *p != '\0'; p += strcspn(p, ":") + (p[strcspn(p, ":")] == ':')) {
        snprintf(file, sizeof file, "%.*s/node", (int)strcspn(p, ":"), p);
        if (access(file, X_OK) == 0) return true;
    }
    return false;
}

bool ifc_readers_are_there(const struct scene_import_limits *limits, char *why, size_t size)
{
    char folder[PATH_LEN];
    if (!has_node())
        snprintf(why, size, "node is not installed");
    else if (!find_folder(limits, folder))
        snprintf(why, size,
                 "the readers of IFC are not installed (`make deps-build` installs them; an installed program looks in "
                 "../share/scanhead/ifc)");
    else
        return true;
    return false;
}

/* One reader's command line, and its process. */
struct command {
    char script[PATH_LEN + 32], memory[48], fineness[16];
    const char *argv[6];
    struct import_apart apart;
};

static void set_command(struct command *c, struct scene_build *b, const char *folder, const char *script,
                        const char *name, struct text_span edits)
{
    const struct scene_import_limits limits = build_limits(b);
    snprintf(c->script, sizeof c->script, "%s/%s", folder, script);
    snprintf(c->memory, sizeof c->memory, "--max-old-space-size=%u", limits.memory_mib);
    const char *const argv[] = {"node", c->memory, c->script, b->spec->file, c->fineness, NULL};
    memcpy(c->argv, argv, sizeof argv);
    c->apart.task = (struct import_task){.b = b, .limits = limits, .name = name, .argv = c->argv, .input = edits};
}

static void ifc_apart_finish(struct import_apart *a, struct ifc_bodies *bodies, bool *has, struct sh_err *said)
{
    *has = import_judge(a, said) == SH_OK && ifc_bodies_read(bodies, a->result_fd, said) == SH_OK;
    import_close(a);
}

void ifc_reason(const struct scene_build *b, const char *name, const struct sh_err *said, char out[IFC_REASON_LEN])
{
    const char *text = said->text;
    const size_t n = strlen(b->name);
    if (strncmp(text, b->name, n) == 0 && text[n] == ':') text += n + 1 + strspn(text + n + 1, " ");
    const char *advice = strstr(text, ": " IMPORT_ELSE_CONVERT);
    const int len = advice != NULL ? (int)(advice - text) : (int)strlen(text);
    const bool is_named = strstr(text, name) != NULL;
    snprintf(out, IFC_REASON_LEN, "%s%s%.*s", is_named ? "" : name, is_named ? "" : ": ", len, text);
}

static int ifc_apart_judge(struct scene_build *b, const struct ifc_readings *out, struct sh_err *err)
{
    const int rc = sh_check_stop(b->report, err);
    if (rc != SH_OK || out->has_web || out->has_lite) return rc;
    char web[IFC_REASON_LEN] = "", lite[IFC_REASON_LEN] = "";
    if (out->web_said.code != 0) ifc_reason(b, "web-ifc", &out->web_said, web);
    if (out->lite_said.code != 0) ifc_reason(b, "ifc-lite", &out->lite_said, lite);
    const bool is_limited = strstr(web, IMPORT_USER_LIMIT) != NULL || strstr(lite, IMPORT_USER_LIMIT) != NULL;
    return sh_fail(err, SH_EINPUT, "%s: no reader can read it: %s%s%s%s", b->name, web,
                   *web != '\0' && *lite != '\0' ? "; " : "", lite, is_limited ? "" : ": " IMPORT_ELSE_CONVERT);
}

int ifc_run_readers(struct scene_build *b, struct ifc_fineness fineness, struct text_span edits,
                    struct ifc_readings *out, struct sh_err *err)
{
    const struct scene_import_limits limits = build_limits(b);
    struct command web = {0}, lite = {0};
    struct import_apart *all[2];
    char folder[PATH_LEN];
    size_t n = 0;
    *out = (struct ifc_readings){0};
    if (!find_folder(&limits, folder)) return build_fail(b, SH_EINPUT, err, "the readers of IFC are not installed");
    set_command(&web, b, folder, "web_ifc.mjs", "web-ifc", edits);
    snprintf(web.fineness, sizeof web.fineness, "%d", fineness.segments);
    set_command(&lite, b, folder, "ifc_lite.mjs", "ifc-lite", edits);
    snprintf(lite.fineness, sizeof lite.fineness, "%s", fineness.level);
    const bool web_asked = limits.ifc_reader != IFC_READER_LITE, lite_asked = limits.ifc_reader != IFC_READER_WEB;
    if (web_asked && import_start(&web.apart, &out->web_said) == SH_OK) all[n++] = &web.apart;
    if (lite_asked && import_start(&lite.apart, &out->lite_said) == SH_OK) all[n++] = &lite.apart;
    import_watch(all, n);
    if (web_asked && web.apart.pid > 0) ifc_apart_finish(&web.apart, &out->web, &out->has_web, &out->web_said);
    if (lite_asked && lite.apart.pid > 0) ifc_apart_finish(&lite.apart, &out->lite, &out->has_lite, &out->lite_said);
    return ifc_apart_judge(b, out, err);
}

void ifc_readings_free(struct ifc_readings *r)
{
    ifc_bodies_free(&r->web);
    ifc_bodies_free(&r->lite);
}
