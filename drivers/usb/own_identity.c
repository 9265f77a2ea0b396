#include "drivers/usb/own_identity.h"

#include <errno.h>
#include <nettle/sha2.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

/* The first line of a file; 0: there is none. */
static size_t read_line(const char *path, char *text, size_t len)
{
    FILE *file = fopen(path, "re");
    text[0] = '\0';
    if (file == NULL) return 0;
    if (fgets(text, (int)len, file) == NULL) text[0] = '\0';
    fclose(file);
    text[strcspn(text, "\n")] = '\0';
    return strlen(text);
}

/* A machine has an id for good (machine-id(5), which asks not to show it as it is), or at least one until it is
 * started again. */
static void put_serial(struct usb_identity *id)
{
    char machine[64], text[96];
    uint8_t digest[SHA256_DIGEST_SIZE];
    struct sha256_ctx ctx;
    if (read_line("/etc/machine-id", machine, sizeof machine) == 0)
        read_line("/proc/sys/kernel/random/boot_id", machine, sizeof machine);
    const int len = snprintf(text, sizeof text, "scanhead %s %u", machine, id->number);
    sha256_init(&ctx);
    sha256_update(&ctx, (size_t)len, (const uint8_t *)text);
    sha256_digest(&ctx, sizeof digest, digest);
    const size_t used = strnlen(id->serial, sizeof id->serial - 10);
    snprintf(id->serial + used, sizeof id->serial - used, "-%02x%02x%02x%02x", digest[0], digest[1], digest[2],
             digest[3]);
}

/* A socket name outside the file system: the kernel gives it to one process, and takes it back when that ends. */
static int claim_number(unsigned number, int *claim)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    const int len = snprintf(at.sun_path + 1, sizeof at.sun_path - 1, "scanhead-usb-%u", number);
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

int usb_own_identity(struct usb_identity *id, int *claim, struct sh_err *err)
{
    int error = EADDRINUSE;
    for (id->number = 1; id->number <= USB_MAX_HEADS; id->number++)
        if ((error = claim_number(id->number, claim)) != EADDRINUSE) break;
    if (error == EADDRINUSE)
        return sh_fail(err, SH_EINPUT,
                       "usb: %d heads on USB run on this machine; allowed %d: end one, or set links[].serial",
                       USB_MAX_HEADS, USB_MAX_HEADS);
    if (error != 0) return sh_fail(err, SH_EIO, "usb: no number for this head: %s", strerror(error));
    put_serial(id);
    return SH_OK;
}
