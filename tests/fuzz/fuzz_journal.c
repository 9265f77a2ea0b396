/* SPDX-License-Identifier: MIT */
/* This fuzzes journals, the manifests of campaigns, and stored settings. The input is the file. A journal that is read
 * must be sorted by tick, and must give the same commands when it is written anew. Settings that are read must be the
 * same after they are written anew. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "firmware_sim/app/studio/batch/manifest.h"
#include "firmware_sim/device/journal.h"
#include "firmware_sim/device/settings_file.h"
#include "tests/fuzz/rig.h"

static void check_again(const struct journal_entry *entry, size_t n)
{
    struct sh_err err = {0};
    struct journal_entry *again = NULL;
    size_t m = 0;
    char path[600];
    snprintf(path, sizeof path, "%s/again.journal", fuzz_folder());
    struct journal *journal = journal_open(path, NULL, &err);
    fuzz_must(journal != NULL, "a journal can be written");
    for (size_t i = 0; i < n; i++)
        if (!journal_is_end(&entry[i]))
            fuzz_must(journal_write(journal, entry[i].tick, entry[i].t_ns, entry[i].session, entry[i].line) == SH_OK,
                      "what was read can be written");
    fuzz_must(journal_close(journal, &err) == SH_OK, "and closed");
    fuzz_must(journal_read(path, &again, &m, &err) == SH_OK, "what was written can be read");
    for (size_t i = 0, k = 0; i < n; i++) {
        if (journal_is_end(&entry[i])) continue;
        fuzz_must(k < m && again[k].tick == entry[i].tick && strcmp(again[k].line, entry[i].line) == 0,
                  "and has the same commands");
        k++;
    }
    free(again);
    unlink(path);
}

static void read_entry(const uint8_t *data, size_t size)
{
    struct batch_entry entry;
    char *line = malloc(size + 1);
    memcpy(line, data, size);
    line[size] = '\0';
    line[strcspn(line, "\n")] = '\0';
    if (batch_entry_read(line, &entry)) {
        for (uint32_t i = 0; i < entry.n_files; i++)
            fuzz_must(strchr(entry.file[i].name, '/') == NULL, "files lie in the campaign's folder");
        batch_entry_free(&entry);
    }
    free(line);
}

/* 0: it is no such file. add: a name for one more setting; NULL: none. */
static int take_settings(const char *path, const char *add, char text[SETTINGS_FILE_TEXT])
{
    struct sh_err err = {0};
    struct settings_file *file;
    if (settings_file_open(path, "puck", NULL, &file, &err) != SH_OK) {
        fuzz_must_be_line(&err);
        return 0;
    }
    settings_file_get(file, "head", text);
    fuzz_must(settings_file_put(file, "head", text) == SH_OK, "what was read can be stored");
    if (add != NULL) settings_file_put(file, add, "a 1\n"); /* there may be no room for it */
    fuzz_must(settings_file_close(file, &err) == SH_OK, "and written");
    return 1;
}

static void read_settings(const uint8_t *data, size_t size)
{
    static const char begin[] = "scanhead";
    char before[SETTINGS_FILE_TEXT], after[SETTINGS_FILE_TEXT];
    if (size < sizeof begin || memcmp(data, begin, sizeof begin - 1) != 0) return; /* the disk takes its time */
    const char *path = fuzz_disk_file("settings", data, size);
    if (!take_settings(path, "cola", before)) return;
    fuzz_must(take_settings(path, NULL, after) && strcmp(before, after) == 0, "what was written can be read");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sh_err err = {0};
    struct journal_entry *entry = NULL;
    size_t n = 0;
    if (size > 8192) return 0;
    read_entry(data, size);
    read_settings(data, size);
    if (journal_read(fuzz_file(".journal", data, size), &entry, &n, &err) != SH_OK) {
        fuzz_must_be_line(&err);
        fuzz_must(entry == NULL, "there are no entries after a failure");
        return 0;
    }
    for (size_t i = 1; i < n; i++)
        fuzz_must(entry[i - 1].tick <= entry[i].tick, "entries are sorted by tick");
    if (n > 0) check_again(entry, n);
    free(entry);
    return 0;
}
