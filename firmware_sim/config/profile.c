/* SPDX-License-Identifier: MIT */
/* Head profiles: where they are, reading one, listing them. */
#include "firmware_sim/config/check_head.h"
#include "firmware_sim/config/check_signal.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/config/profile_keys.h"
#include "firmware_sim/config/profiles.h"
#include "firmware_sim/config/reference.h"
#include "firmware_sim/config/shared.h"
#include "firmware_sim/config/table/diagnostics.h"
#include "firmware_sim/config/table/document.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"
#include "firmware_sim/config/table/value.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { MAX_DIRS = 6 };

struct profile_dirs {
    char dir[MAX_DIRS][CONFIG_PATH_LEN];
    int n;
};

/* Writes the i-th of the places of cfg_find_shared, from 0. Returns 0 if there is none. */
static int shared_path(int i, const char *name, char *buf)
{
    static const char *const beside[] = {"../share/scanhead", "../config"};
    char program[CONFIG_PATH_LEN];
    if (i == 2) snprintf(buf, CONFIG_PATH_LEN, "config/%s", name);
    if (i >= 2) return i == 2;
    const ssize_t n = readlink("/proc/self/exe", program, sizeof program - 1);
    char *slash = n > 0 ? memrchr(program, '/', (size_t)n) : NULL;
    if (slash == NULL) slash = program;
    const int len = snprintf(buf, CONFIG_PATH_LEN, "%.*s/%s/%s", (int)(slash - program), program, beside[i], name);
    if (len >= CONFIG_PATH_LEN) buf[0] = '\0'; /* a path that is too long names no file */
    return 1;
}

int cfg_find_shared(const char *name, char *buf)
{
    for (int i = 0; shared_path(i, name, buf); i++)
        if (access(buf, R_OK) == 0) return 1;
    return 0;
}

static void find_dirs(const char *config_file, struct profile_dirs *dirs)
{
    const char *given = getenv("SCANHEAD_HEADS");
    char base[CONFIG_PATH_LEN];
    dirs->n = 0;
    if (given != NULL && given[0] != '\0') snprintf(dirs->dir[dirs->n++], CONFIG_PATH_LEN, "%s", given);
    if (config_file != NULL)
        snprintf(dirs->dir[dirs->n++], CONFIG_PATH_LEN, "%.*sheads", CONFIG_PATH_LEN - 6,
                 cfg_dir_of(config_file, base));
    for (int i = 0; shared_path(i, "heads", dirs->dir[dirs->n]); i++)
        if (dirs->dir[dirs->n][0] != '\0') dirs->n++;
}

/* A folder that the user names and that can't be read must not let another folder's profile take its place. */
static int check_given_dir(struct sh_err *err)
{
    const char *given = getenv("SCANHEAD_HEADS");
    if (given == NULL || given[0] == '\0') return SH_OK;
    DIR *dir = opendir(given);
    if (dir != NULL) return closedir(dir), SH_OK;
    return sh_fail(err, SH_EINPUT, "SCANHEAD_HEADS: %s: %s; allowed is a folder of head profiles, or none", given,
                   strerror(errno));
}

int cfg_is_yaml(const char *name)
{
    size_t len = strlen(name);
    return len > 5 && strcmp(name + len - 5, ".yaml") == 0;
}

static int is_shown(const struct dirent *entry)
{
    return cfg_is_yaml(entry->d_name) && entry->d_name[0] != '.';
}

/* Finds the YAML files of a folder, sorted, but not hidden ones. Returns how many; -1: the folder can't be read. */
static int list_yaml(const char *dir, struct dirent ***entries)
{
    *entries = NULL;
    return scandir(dir, entries, is_shown, alphasort);
}

void cfg_name_yaml(const char *dir, char *buf, size_t len)
{
    struct dirent **entries;
    const int n = list_yaml(dir, &entries);
    for (int i = 0; i < n; i++) {
        char *name = entries[i]->d_name;
        name[strlen(name) - 5] = '\0';
        if (!cfg_list_has(buf, name)) cfg_list_add(buf, len, name);
        free(entries[i]);
    }
    free(entries);
}

/* Says in buf which profiles the directories have. */
static void allow_profiles(const struct profile_dirs *dirs, char *buf, size_t len)
{
    char known[CFG_ALLOWED_MAX] = "";
    for (int d = 0; d < dirs->n; d++)
        cfg_name_yaml(dirs->dir[d], known, sizeof known);
    if (known[0] != '\0')
        snprintf(buf, len, "allowed %s", known);
    else
        snprintf(buf, len, "no profiles were found at all; SCANHEAD_HEADS can name their directory");
}

/* ---- one profile */

/* Checks that a figure is not above another one; with `strictly`, nor equal to it. */
static void check_order(struct cfg_reader *rd, const char *low_key, double low, const char *high_key, double high,
                        int strictly)
{
    if (low < high || (low == high && !strictly) || !CFG_SOUND(rd, low_key, high_key)) return;
    cfg_fail_key(rd, low_key, "%.15g is too large; allowed %s %.15g", low, strictly ? "below" : "at most", high);
}

static void check_sweep(struct cfg_reader *rd, const struct config_profile *p)
{
    double sweep_deg = 360.0 / p->facets * p->optical_gain,
           fov_deg = (double)(p->fov_max_udeg - p->fov_min_udeg) * 1e-6;
    if (!CFG_SOUND(rd, "facets", "optical_gain")) return;
    if (sweep_deg > 360.0)
        cfg_fail_key(rd, "optical_gain", "a sweep of 360 / facets * optical_gain is %.10g deg; allowed up to 360",
                     sweep_deg);
    /* 1e-9 allows for rounding, which is far below one micro-degree. */
    else if (fov_deg > sweep_deg + 1e-9 && CFG_SOUND(rd, "fov_min_deg", "fov_max_deg"))
        cfg_fail_key(rd, "fov_max_deg",
                     "a field of view of %.10g deg does not fit into a sweep; allowed up to %.10g deg, "
                     "360 / facets * optical_gain",
                     fov_deg, sweep_deg);
}

/* Checks the figures of a mirror and a pan. */
static void check_line_head(struct cfg_reader *rd, const struct config_profile *p)
{
    const double lines_min_hz = from_micro(p->lines_min_uhz), prr_max_hz = from_micro(p->prr_max_uhz);
    const double pan_min_deg = from_micro(p->pan_min_udeg), pan_max_deg = from_micro(p->pan_max_udeg);
    check_order(rd, "prr_min_hz", from_micro(p->prr_min_uhz), "prr_max_hz", prr_max_hz, 0);
    if (prr_max_hz < lines_min_hz && CFG_SOUND(rd, "prr_max_hz", "lines_min_hz"))
        cfg_fail_key(rd, "prr_max_hz", "less than a pulse per line; allowed at least %.15g", lines_min_hz);
    check_order(rd, "fov_min_deg", from_micro(p->fov_min_udeg), "fov_max_deg", from_micro(p->fov_max_udeg), 1);
    if ((p->pan_min_udeg >= p->pan_max_udeg || p->pan_max_udeg - p->pan_min_udeg > 360000000) &&
        CFG_SOUND(rd, "pan_min_deg", "pan_max_deg"))
        cfg_fail_key(rd, "pan_max_deg", "%.15g does not fit; allowed above %.15g, up to %.15g", pan_max_deg,
                     pan_min_deg, pan_min_deg + 360.0);
    check_sweep(rd, p);
}

static void check_profile(struct cfg_reader *rd, struct config_profile *p)
{
    cfg_check_emitter(rd, p);
    if (p->arrangement.kind == EMITTER_LINE && CFG_SOUND(rd, "emitter")) check_line_head(rd, p);
    check_order(rd, "lines_min_hz", from_micro(p->lines_min_uhz), "lines_max_hz", from_micro(p->lines_max_uhz), 0);
    check_order(rd, "range_min_m", p->range_min_m, "range_max_m", p->range_max_m, 1);
    check_order(rd, "range_sigma_floor_m", p->range_sigma_floor_m, "range_sigma_m", p->range_sigma_m, 0);
    cfg_convert_widths(rd, p);
    cfg_check_programs(rd, p);
    cfg_check_reaches(rd, p);
}

/* The profile is named by its file: a second name inside could differ. */
static int name_profile(struct cfg_reader *rd, struct config_profile *profile)
{
    const char *base = basename(rd->file);
    size_t stem = strlen(base) - 5;
    if (stem == 0 || stem >= sizeof profile->name)
        return cfg_fail_file(rd, SH_EINPUT, 0,
                             "the file's name is the name of the profile; allowed 1 to %zu characters and .yaml",
                             sizeof profile->name - 1);
    for (size_t i = 0; i < stem; i++)
        if ((unsigned char)base[i] <= 0x20 || (unsigned char)base[i] >= 0x7f)
            return cfg_fail_file(rd, SH_EINPUT, 0,
                                 "the file's name is the name of the profile; allowed printable ASCII");
    memcpy(profile->name, base, stem);
    return SH_OK;
}

/* Reads a profile's file, and checks it. Returns whether the file has no diagnostic. */
static int read_profile(struct cfg_reader *rd, const char *file, struct config_profile *profile,
                        struct config_diagnostics *diagnostics)
{
    const uint32_t before = diagnostics->n;
    memset(profile, 0, sizeof *profile);
    cfg_reader_init(rd, file, &cfg_profile_table, profile, diagnostics);
    if (name_profile(rd, profile) == SH_OK && cfg_read_file(rd) == SH_OK) {
        cfg_fill_defaults(rd, NULL);
        check_profile(rd, profile);
    }
    return diagnostics->n == before;
}

/* ---- lookup */

static int fail_lookup(struct cfg_reader *rd, struct config *cfg, const struct profile_dirs *dirs)
{
    char allowed[CFG_ALLOWED_MAX + 16], shown[CFG_SHOW_MAX];
    allow_profiles(dirs, allowed, sizeof allowed);
    return cfg_fail_key(rd, "head.profile", "no profile \"%s\"; %s", cfg_show(cfg->profile_file, shown), allowed);
}

static int find_profile(struct cfg_reader *rd, struct config *cfg)
{
    struct profile_dirs dirs;
    char path[2 * CONFIG_PATH_LEN], base[CONFIG_PATH_LEN];
    int from_set = cfg_where(rd, cfg_find(&rd->table, "head.profile"), 0) == CFG_FROM_SET;
    find_dirs(cfg->file, &dirs);
    int by_path = cfg_is_yaml(cfg->profile_file);
    struct sh_err why;
    if (!by_path && check_given_dir(&why) != SH_OK) return cfg_fail_key(rd, "head.profile", "%s", why.text);
    if (!by_path && strchr(cfg->profile_file, '/') != NULL) return fail_lookup(rd, cfg, &dirs);
    for (int i = 0; i < (by_path ? 1 : dirs.n); i++) {
        if (!by_path)
            snprintf(path, sizeof path, "%s/%s.yaml", dirs.dir[i], cfg->profile_file);
        else
            snprintf(path, sizeof path, "%s%s",
                     from_set || cfg->profile_file[0] == '/' ? "" : cfg_dir_of(cfg->file, base), cfg->profile_file);
        if (access(path, F_OK) != 0) continue;
        if (strlen(path) >= sizeof cfg->profile_file)
            return cfg_fail_key(rd, "head.profile", "its path is too long; allowed up to %zu bytes",
                                sizeof cfg->profile_file - 1);
        memcpy(cfg->profile_file, path, strlen(path) + 1);
        return SH_OK;
    }
    return fail_lookup(rd, cfg, &dirs);
}

void cfg_load_profile(struct cfg_reader *rd, struct config *cfg)
{
    struct cfg_reader profile_rd;
    if (!CFG_SOUND(rd, "head.profile")) return;
    if (cfg->profile_file[0] == '\0')
        cfg_fail_key(rd, "head.profile", "missing; required is the name of a profile, or a path that ends in .yaml");
    else if (find_profile(rd, cfg) == SH_OK)
        rd->profile_read = read_profile(&profile_rd, cfg->profile_file, &cfg->profile, rd->diagnostics);
}

int config_load_profile(const char *name, const char *config_file, struct config_profile *profile, struct sh_err *err)
{
    struct profile_dirs dirs;
    struct cfg_reader rd;
    struct config_diagnostics diagnostics = {0};
    char path[2 * CONFIG_PATH_LEN], allowed[CFG_ALLOWED_MAX + 16];
    if (check_given_dir(err) != SH_OK) return err->code;
    find_dirs(config_file, &dirs);
    for (int i = 0; i < dirs.n; i++) {
        snprintf(path, sizeof path, "%s/%s.yaml", dirs.dir[i], name);
        if (access(path, F_OK) != 0) continue;
        if (read_profile(&rd, path, profile, &diagnostics)) return SH_OK;
        return sh_fail(err, diagnostics.err[0].code, "%s", diagnostics.err[0].text);
    }
    allow_profiles(&dirs, allowed, sizeof allowed);
    return sh_fail(err, SH_EINPUT, "no head profile \"%s\"; %s", name, allowed);
}

/* ---- listing */

static int list_profile(const char *dir, const char *entry, FILE *out, struct sh_err *err)
{
    char path[2 * CONFIG_PATH_LEN];
    struct cfg_reader rd;
    struct config_profile profile;
    struct config_diagnostics diagnostics = {0};
    snprintf(path, sizeof path, "%s/%s", dir, entry);
    if (!read_profile(&rd, path, &profile, &diagnostics))
        return sh_fail(err, diagnostics.err[0].code, "%s", diagnostics.err[0].text);
    cfg_list_profile(&rd, &profile, out);
    return SH_OK;
}

int config_list_profiles(const char *dir, FILE *out, struct sh_err *err)
{
    struct profile_dirs dirs;
    if (dir == NULL) {
        if (check_given_dir(err) != SH_OK) return err->code;
        find_dirs(NULL, &dirs);
        for (int i = 0; i < dirs.n && dir == NULL; i++)
            if (access(dirs.dir[i], R_OK) == 0) dir = dirs.dir[i];
        if (dir == NULL) return sh_fail(err, SH_EINPUT, "no directory of head profiles found; set SCANHEAD_HEADS");
    }
    struct dirent **entries;
    int n = list_yaml(dir, &entries), code = SH_OK;
    if (n < 0) return sh_fail(err, SH_EINPUT, "%s: cannot be read; a directory of head profiles is needed", dir);
    for (int i = 0; i < n; i++) {
        if (code == SH_OK) code = list_profile(dir, entries[i]->d_name, out, err);
        free(entries[i]);
    }
    free(entries);
    return code == SH_OK ? n : code;
}
