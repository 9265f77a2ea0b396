/* SPDX-License-Identifier: MIT */
/* This fuzzes `record --repair`, on files as a killed recorder leaves them, of any format. The input is a byte (ending,
 * whether as FILE.part), then the file. A repaired file must be whole, so a second repair finds nothing to do. A
 * refused file must stay as it was. */
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "drivers/protocol/crc32c.h"
#include "drivers/record/repair.h"
#include "tests/fuzz/rig.h"
#include "tests/fuzz/seal.h"

enum { MAX_INPUT = 1 << 15, E57_PAGE = 1024, E57_DATA = 1020 };

static const char *const endings[] = {".ply", ".las", ".ptx", ".e57", ".pcapng", ".shs", ".obj", ".poses.csv"};
enum { N_ENDINGS = 8, AT_E57 = 3, AT_PCAPNG = 4, AT_SHS = 5 };

/* E57 ends each page with its checksum, with the most significant byte first. */
static void seal_pages(uint8_t *bytes, size_t size)
{
    for (size_t at = 0; at + E57_PAGE <= size; at += E57_PAGE) {
        const uint32_t crc = crc32c(0, bytes + at, E57_DATA);
        for (int i = 0; i < 4; i++)
            bytes[at + E57_DATA + (size_t)i] = (uint8_t)(crc >> (24 - 8 * i));
    }
}

static int is_same(const char *path, const uint8_t *bytes, size_t size)
{
    static uint8_t now[MAX_INPUT + 1];
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    const ssize_t n = fd >= 0 ? read(fd, now, sizeof now) : -1;
    if (fd >= 0) close(fd);
    return n == (ssize_t)size && memcmp(now, bytes, size) == 0;
}

static void check_again(const char *path)
{
    struct repaired second;
    struct sh_err err = {0};
    const int rc = repair_file(path, &fuzz_report, &second, &err);
    if (rc != SH_OK) fprintf(stderr, "second repair: %s\n", err.text);
    fuzz_must(rc == SH_OK, "what was repaired can be checked");
    fuzz_must(second.was_whole && second.cut_bytes == 0, "what was repaired is whole");
    repair_free(&second);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t bytes[MAX_INPUT];
    struct fuzz_bytes in = {data, size};
    const unsigned how = fuzz_u8(&in), kind = how % N_ENDINGS;
    struct repaired first;
    struct sh_err err = {0};
    char name[64], final[700];
    if (in.n > sizeof bytes) return 0;
    memcpy(bytes, in.p, in.n);
    if (kind == AT_E57 && (how & 16) == 0) seal_pages(bytes, in.n);
    if ((kind == AT_SHS || kind == AT_PCAPNG) && (how & 16) == 0) fuzz_seal(bytes, in.n);
    snprintf(name, sizeof name, "left%s%s", endings[kind], (how & 8) != 0 ? "" : ".part");
    snprintf(final, sizeof final, "%s/left%s", fuzz_folder(), endings[kind]);
    const char *path = fuzz_disk_file(name, bytes, in.n);
    if (repair_file(path, &fuzz_report, &first, &err) == SH_OK) {
        fuzz_must(first.unit != NULL, "it says what it has counted");
        if (first.was_whole) fuzz_must(is_same(final, bytes, in.n), "nothing of a whole file is changed");
        repair_free(&first);
        check_again(final);
    } else {
        fuzz_must_be_line(&err);
        fuzz_must(is_same(path, bytes, in.n), "what is refused is as it was");
    }
    unlink(path);
    unlink(final);
    return 0;
}
