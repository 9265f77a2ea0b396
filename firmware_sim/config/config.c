/* config_load: file, --set, profile, defaults, checks, in this order; and the reference. */
#include "firmware_sim/config/table.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

static void fail_missing(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item)
{
    char allowed[CFG_ALLOWED_MAX];
    cfg_fail_key(rd, key->path, item, "missing, and it has no default; %s", cfg_allowed(key, allowed));
}

/* A bad value gives way to the default, so that what is computed from it can't fail. */
static void fill_one(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item,
                     const struct config_profile *profile)
{
    unsigned char *bad = &rd->bad[cfg_row(rd, key)][item];
    if (rd->line[cfg_row(rd, key)][item] != 0 && !*bad) return;
    if (key->def == NULL && !*bad) fail_missing(rd, key, item);
    if (key->def == NULL || key->def[0] == '\0') return; /* an empty text; the struct starts as zeros */
    if (key->def[0] != '@') {
        cfg_store(rd, key, item, rd->root_line, key->def, "");
    } else if (rd->profile_read) {
        const struct cfg_key *figure = cfg_find(&cfg_profile_table, key->def + 1);
        memcpy(cfg_address(rd, key, item), (const char *)profile + figure->offset, key->size);
    } else {
        *bad = 1;
    }
}

void cfg_fill_defaults(struct cfg_reader *rd, const struct config_profile *profile)
{
    for (size_t i = 0; i < rd->table.n; i++) {
        const struct cfg_key *key = &rd->table.keys[i], *list = cfg_list_of(&rd->table, key);
        if (key->type == CFG_MAP) continue;
        if (key->type == CFG_LIST) {
            if (*cfg_list_count(rd, key) < key->min) fail_missing(rd, key, 0);
            continue;
        }
        uint32_t n = list != NULL ? *cfg_list_count(rd, list) : 1;
        for (uint32_t item = 0; item < n; item++)
            fill_one(rd, key, item, profile);
    }
}

int config_load_all(const char *path, const char *const *sets, int n_sets, struct config *cfg,
                    struct config_faults *faults)
{
    struct cfg_reader rd;
    memset(cfg, 0, sizeof *cfg);
    memset(faults, 0, sizeof *faults);
    if (strlen(path) >= sizeof cfg->file) {
        faults->n = 1;
        return sh_fail(&faults->fault[0], SH_EINPUT, "%.100s...: path too long; allowed up to %zu bytes", path,
                       sizeof cfg->file - 1);
    }
    snprintf(cfg->file, sizeof cfg->file, "%s", path);
    cfg_reader_init(&rd, cfg->file, &cfg_config_table, cfg, faults);
    if (cfg_read_file(&rd) == SH_OK) {
        for (int i = 0; i < n_sets; i++)
            cfg_apply_set(&rd, sets[i]);
        cfg_load_profile(&rd, cfg);
        cfg_fill_defaults(&rd, &cfg->profile);
        cfg_check(&rd, cfg);
    }
    return faults->n == 0 ? SH_OK : faults->fault[0].code;
}

int config_load(const char *path, const char *const *sets, int n_sets, struct config *cfg, struct sh_err *err)
{
    struct config_faults faults;
    int code = config_load_all(path, sets, n_sets, cfg, &faults);
    return code == SH_OK ? SH_OK : sh_fail(err, code, "%s", faults.fault[0].text);
}

uint32_t config_threads(const struct config *cfg)
{
    long n = cfg->loop.threads != 0 ? (long)cfg->loop.threads : sysconf(_SC_NPROCESSORS_ONLN);
    return n < 1 ? 1 : n > CONFIG_MAX_THREADS ? CONFIG_MAX_THREADS : (uint32_t)n;
}

/* ---- the reference */

static const char *type_name(const struct cfg_key *key)
{
    static const char *const names[] = {
        [CFG_MAP] = "section",       [CFG_LIST] = "list",          [CFG_BOOL] = "switch",
        [CFG_ENUM] = "word",         [CFG_COUNT] = "whole number", [CFG_MICRO] = "number, exact to 1e-6",
        [CFG_REAL] = "number",       [CFG_TEXT] = "text",          [CFG_PATH] = "path",
        [CFG_VEC3] = "three numbers"};
    return names[key->type];
}

/* Within 100 columns, four blanks before each line. */
static void print_wrapped(const char *text, FILE *out)
{
    enum { INDENT = 4, WIDTH = 100 };
    int column = 0;
    while (*text != '\0') {
        int n = (int)strcspn(text, " ");
        int begins = column == 0 || column + 1 + n > WIDTH;
        fprintf(out, "%s%*s%.*s", begins && column != 0 ? "\n" : "", begins ? INDENT : 1, "", n, text);
        column = begins ? INDENT + n : column + 1 + n;
        text += n + (text[n] == ' ');
    }
    fputc('\n', out);
}

static void print_key(const struct cfg_key *key, FILE *out)
{
    char allowed[CFG_ALLOWED_MAX];
    fprintf(out, "%s\n    %s", key->path, type_name(key));
    if (key->type != CFG_MAP) {
        if (key->unit != NULL) fprintf(out, ", %s", key->unit);
        fprintf(out, "; %s", cfg_allowed(key, allowed));
        if (key->def == NULL && (key->type != CFG_LIST || key->min > 0))
            fputs("; required", out);
        else if (key->def != NULL && key->def[0] == '@')
            fprintf(out, "; default %s of the profile", key->def + 1);
        else if (key->def != NULL && key->def[0] != '\0')
            fprintf(out, "; default %s", key->def);
        else
            fputs("; optional", out);
    }
    fputc('\n', out);
    print_wrapped(key->help, out);
}

void config_print_reference(FILE *out)
{
    /* clang-format off */
    fputs("Configuration, YAML. Any key can be set with --set KEY=VALUE (elements as in stations[0].name=gate; the\n"
          "index after the last one appends). Numbers are decimal, as in 300000, 0.5 or 1.2e6, without a unit.\n"
          "Relative paths start at the file they stand in; in --set, at the working directory.\n\n",
          out);
    /* clang-format on */
    for (size_t i = 0; i < cfg_config_table.n; i++)
        print_key(&cfg_config_table.keys[i], out);
    fputs("\nHead profile, heads/NAME.yaml. maker and model are texts; each figure is written\n"
          "{ value: V, from: data sheet } or { value: V, from: assumed }.\n\n",
          out);
    for (size_t i = 0; i < cfg_profile_table.n; i++)
        print_key(&cfg_profile_table.keys[i], out);
}
