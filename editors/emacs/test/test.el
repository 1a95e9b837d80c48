;;; test.el --- real files, real server -*- lexical-binding: t -*-

(dolist (folder (file-expand-wildcards "/usr/share/emacs/site-lisp/elpa/*"))
  (add-to-list 'load-path folder))
(defvar top (expand-file-name "../../../" (file-name-directory load-file-name)))
(add-to-list 'load-path (expand-file-name "editors/emacs" top))
(setq large-file-warning-threshold nil
      vc-handled-backends nil
      eglot-connect-timeout 60)
(require 'gcc-robot)
(require 'flymake)
(require 'seq)
(setq gcc-robot-program (getenv "GCC_ROBOT_BIN"))

(defvar scratch (make-temp-file "gcc-robot" t))

(defun open-copy (path &optional name)
  "Open a copy of the shipped file PATH and connect."
  (let ((copy (expand-file-name (or name (file-name-nondirectory path)) scratch)))
    (copy-file (expand-file-name path top) copy t)
    (find-file copy)
    (unless (eglot-managed-p)
      (apply #'eglot--connect (eglot--guess-contact))
      (eglot--maybe-activate-editing-mode))
    (current-buffer)))

(defun wait-for (what test)
  "Wait until TEST gives something."
  (let ((end (+ (float-time) 20)) answer)
    (while (not (setq answer (funcall test)))
      (when (> (float-time) end) (error "Waited in vain for %s" what))
      (accept-process-output nil 0.05))
    answer))

(defun ask (method &rest more)
  "Send METHOD for the place of point."
  (jsonrpc-request (eglot--current-server-or-lose) method (append (eglot--TextDocumentPositionParams) more)))

(defun has (text part)
  (unless (string-match-p (regexp-quote part) text) (error "`%s' is not in\n%s" part text)))

(defvar published (make-hash-table :test #'equal))
(cl-defmethod eglot-handle-notification :before (_server (_method (eql textDocument/publishDiagnostics)) &key uri diagnostics &allow-other-keys)
  (puthash (file-name-nondirectory uri) diagnostics published))

(defmacro check (name &rest body)
  (declare (indent 1))
  `(progn ,@body (message "ok      %s" ,name)))

(check "modes by name and header"
  (open-copy "docs/examples/flange.ngc" "PART.NGC")
  (cl-assert (eq major-mode 'gcode-mode))
  (open-copy "tests/golden/ufsc2016/example1.p21" "plan.stp")
  (cl-assert (eq major-mode 'p21-mode)))

(check "diagnostics"
  (open-copy "docs/examples/mistakes.ngc")
  (let* ((found (wait-for "diagnostics" (lambda () (let ((d (gethash "mistakes.ngc" published))) (and d (>= (length d) 4) d)))))
         (arc (seq-find (lambda (d) (equal (plist-get d :code) "E0203")) found)))
    (has (plist-get arc :message) "radius 4.0000 at the start, 6.0000 at the end")
    (cl-assert (= 6 (plist-get (plist-get (plist-get arc :range) :start) :line)))))

(check "hover"
  (open-copy "docs/examples/flange.ngc")
  (goto-char (point-min))
  (search-forward "G43")
  (backward-char 2)
  (has (downcase (format "%s" (ask :textDocument/hover))) "tool length"))

(check "definition by xref"
  (goto-char (point-min))
  (search-forward "o<contour> call")
  (goto-char (+ (line-beginning-position) 3))
  (xref-find-definitions "contour")
  (has (buffer-substring (line-beginning-position) (line-end-position)) "o<contour> sub"))

(check "rename"
  (goto-char (point-min))
  (search-forward "o<contour> call")
  (goto-char (+ (line-beginning-position) 3))
  (let ((eglot-confirm-server-initiated-edits nil)) (eglot-rename "outline"))
  (goto-char (point-min))
  (cl-assert (= 4 (how-many "o<outline>")))
  (cl-assert (= 0 (how-many "o<contour>"))))

(check "formatting"
  (goto-char (point-min))
  (search-forward "G64 P0.02")
  (replace-match "  g64   p0.02" t)
  (eglot-format-buffer)
  (goto-char (point-min))
  (search-forward "\nG64 P0.02\n"))

(check "files that programs are run with"
  (open-copy "docs/examples/irb2400-cell.toml")
  (cl-assert (eq major-mode 'gcc-robot-file-mode))
  (with-temp-file (expand-file-name "mill.tbl" scratch) (insert "T1 P1 D6 ;end mill\n"))
  (find-file (expand-file-name "mill.tbl" scratch))
  (cl-assert (eq major-mode 'gcc-robot-file-mode))
  (unless (eglot-managed-p)
    (apply #'eglot--connect (eglot--guess-contact))
    (eglot--maybe-activate-editing-mode))
  (goto-char (point-min))
  (has (format "%s" (ask :textDocument/hover)) "tool number")
  (with-temp-file (expand-file-name "other.toml" scratch) (insert "[package]\nname = 1\n"))
  (find-file (expand-file-name "other.toml" scratch))
  (cl-assert (not (eq major-mode 'gcc-robot-file-mode))))

(message "Emacs %s" emacs-version)
(delete-directory scratch t)
(kill-emacs 0)
