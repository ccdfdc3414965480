/* Files of a batch that could not be read. The service keeps no such files, so this tab remembers them. */

const KEY = "lobefit-unread";

/** Remember the problems of a batch's files: [{name, fields}]. */
export function keepUnread(batch, found) {
  sessionStorage.setItem(`${KEY} ${batch}`, JSON.stringify(found));
}

export function unreadOf(batch) {
  return JSON.parse(sessionStorage.getItem(`${KEY} ${batch}`) ?? "[]");
}
