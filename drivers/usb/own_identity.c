/* SPDX-License-Identifier: MIT */
#include "drivers/usb/own_identity.h"

#include <errno.h>
#include <nettle/sha2.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "core/bytes.h"
#include "drivers/usb/sysfile.h"

static void digest_text(const char *text, size_t len, uint8_t digest[SHA256_DIGEST_SIZE])
{
    struct sha256_ctx ctx;
    sha256_init(&ctx);
    sha256_update(&ctx, len, (const uint8_t *)text);
    sha256_digest(&ctx, SHA256_DIGEST_SIZE, digest);
}

/* A machine has a permanent id, or at least one until it is started again. machine-id(5) asks not to show the id, so it
 * is hashed. */
static void put_serial(struct usb_identity *id, const char *whose, unsigned place)
{
    char machine[64] = "", text[400];
    uint8_t digest[SHA256_DIGEST_SIZE];
    if (sysfile_read("/etc", "machine-id", machine, sizeof machine) != 0 || machine[0] == '\0')
        sysfile_read("/proc/sys/kernel/random", "boot_id", machine, sizeof machine);
    const int len = snprintf(text, sizeof text, "scanhead %s %u %.299s", machine, place, whose);
    digest_text(text, (size_t)len, digest);
    const size_t used = strnlen(id->serial, sizeof id->serial - 10);
    snprintf(id->serial + used, sizeof id->serial - used, "-%08x", be_get32(digest));
}

/* A socket name outside the file system: the kernel gives it to one process, and takes the name back when that process
 * ends. */
static int claim_name(const char *name, unsigned number, int *claim)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    const int len = snprintf(at.sun_path + 1, sizeof at.sun_path - 1, "scanhead-usb-%s%u", name, number);
    *claim = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (*claim < 0) return errno;
    if (bind(*claim, (struct sockaddr *)&at, (socklen_t)(offsetof(struct sockaddr_un, sun_path) + 1 + (size_t)len)) ==
        0)
        return 0;
    const int error = errno;
    close(*claim);
    *claim = -1;
    return error;
}

/* Claims the lowest number that is free under that name, from 1 on. Returns 0 or an errno; EADDRINUSE: none is free. */
static int claim_lowest(const char *name, unsigned *number, int *claim)
{
    int error = EADDRINUSE;
    for (*number = 1; *number <= USB_MAX_HEADS; ++*number)
        if ((error = claim_name(name, *number, claim)) != EADDRINUSE) break;
    return error;
}

int usb_own_identity(struct usb_identity *id, const char *whose, struct usb_claims *claims, struct sh_err *err)
{
    uint8_t digest[SHA256_DIGEST_SIZE];
    char name[24];
    unsigned place;
    digest_text(whose, strlen(whose), digest);
    snprintf(name, sizeof name, "%08x%08x-", be_get32(digest), be_get32(digest + 4));
    int error = claim_lowest("", &id->number, &claims->number);
    if (error == 0) error = claim_lowest(name, &place, &claims->place);
    if (error == EADDRINUSE)
        return sh_fail(err, SH_EINPUT,
                       "usb: %d heads on USB run on this machine; allowed are %d: end one, or set links[].serial",
                       USB_MAX_HEADS, USB_MAX_HEADS);
    if (error != 0)
        return sh_fail(err, SH_EIO, "usb: no serial number can be chosen for this head: %s", strerror(error));
    put_serial(id, whose, place);
    return SH_OK;
}

void usb_give_up(struct usb_claims *claims)
{
    if (claims->number >= 0) close(claims->number);
    if (claims->place >= 0) close(claims->place);
    *claims = USB_NO_CLAIMS;
}
